"""What `import optics` offers to scripts: problems, systems, models, designs."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.api.design_figures import DesignFigures as DesignFigures
    from optics.api.design_files import Written as Written, helpers as helpers, write_result as write_result
    from optics.api.design_result import Design as Design
    from optics.api.design_run import design as design, shaped as shaped
    from optics.api.engine_choice import engine_of as engine_of
    from optics.api.irradiance_model import DEVICE as DEVICE, Model as Model
    from optics.api.minimisation import Minimum as Minimum, minimise as minimise
    from optics.api.prepared_problem import prepared_system as prepared_system
    from optics.api.scenes import mitsuba_scene as mitsuba_scene
    from optics.api.scripting_system import System as System

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
