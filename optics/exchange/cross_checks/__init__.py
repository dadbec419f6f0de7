"""The light of a design by independent programs, which read nothing but its STEP file."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .file_tracers import file_tracer, require_traced, require_tracer
    from .light_comparison import LightComparison, compare_light
    from .light_verification import light_comparison_checks, light_comparison_lines

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
