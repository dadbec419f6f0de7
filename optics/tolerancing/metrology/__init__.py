"""Lenses as they were made: measured files, alignment, the made surface, and its light."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .alignment import best_fit as best_fit, by_datums as by_datums
    from .as_built_light import AsBuilt, Side, Way, default_side, light_as_built, surface_of
    from .as_built_text import as_built_data, as_built_lines
    from .corrected_surface import made_surface as made_surface
    from .measured_points import FileFrame as FileFrame, MeasuredPoints, read_measured as read_measured

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
