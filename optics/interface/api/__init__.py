"""What `import optics` offers to scripts: problems, systems, models, designs."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .design_errors import form_tolerances, monte_carlo, require_monte_carlo, tolerances
    from .design_figures import DesignFigures
    from .design_files import Written, helpers, write_result
    from .design_result import Design
    from .design_run import design, designed
    from .irradiance_model import Model
    from .minimisation import Minimum, minimise
    from .prepared_problem import engine_of, prepared, require_engine
    from .rendered_design import mitsuba_scene
    from .scripting_system import System

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
