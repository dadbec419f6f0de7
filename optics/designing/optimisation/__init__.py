"""The design loop: start, optimise, refine, checkpoint."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.designing.optimisation.bounded_variables import BoundedVariables
    from optics.designing.optimisation.first_state import StartChoice, first_fit
    from optics.designing.optimisation.indicators import mark, vertex_knots
    from optics.designing.optimisation.level_objective import (
        PROBES,
        Indicators,
        can_cross,
        penalised_objective,
        stage_objective,
        stage_window,
        window_named,
    )
    from optics.designing.optimisation.limited_shapes import LimitedShapes
    from optics.designing.optimisation.loop import Listener, shape_lens, transmitted_flux
    from optics.designing.optimisation.objective import Objective
    from optics.designing.optimisation.re_aim import ROUNDS, re_aimed
    from optics.designing.optimisation.stage_plan import MARGIN, Stage, last_level, stage_seconds, stages
    from optics.designing.optimisation.stage_search import Interrupted
    from optics.designing.optimisation.state import Row, State, earlier_state

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
