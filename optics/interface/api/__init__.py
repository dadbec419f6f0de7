"""What `import optics` offers to scripts: problems, systems, models, designs."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .design_errors import (
        form_tolerances as form_tolerances,
        monte_carlo as monte_carlo,
        require_monte_carlo as require_monte_carlo,
        tolerances as tolerances,
    )
    from .design_figures import DesignFigures as DesignFigures
    from .design_files import helpers as helpers, write_result as write_result
    from .design_result import Design as Design
    from .design_run import design as design, designed as designed
    from .irradiance_model import Model as Model
    from .minimisation import Minimum as Minimum, minimise as minimise
    from .prepared_problem import engine_of as engine_of, prepared as prepared
    from .scenes import mitsuba_scene as mitsuba_scene
    from .scripting_system import System as System

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
