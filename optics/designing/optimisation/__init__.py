"""The design loop: start, optimise, refine, checkpoint."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.designing.optimisation.bounded_variables import BoundedVariables as BoundedVariables
    from optics.designing.optimisation.indicators import (
        mark as mark,
        vertex_knots as vertex_knots,
    )
    from optics.designing.optimisation.level_objective import (
        PROBES as PROBES,
        Indicators as Indicators,
        can_cross as can_cross,
        penalised_objective as penalised_objective,
        stage_objective as stage_objective,
        stage_window as stage_window,
        window_named as window_named,
    )
    from optics.designing.optimisation.loop import (
        Listener as Listener,
        shape_lens as shape_lens,
        transmitted_flux as transmitted_flux,
    )
    from optics.designing.optimisation.objective import Objective as Objective
    from optics.designing.optimisation.stage_plan import (
        MARGIN as MARGIN,
        Stage as Stage,
        last_level as last_level,
        stage_seconds as stage_seconds,
        stages as stages,
    )
    from optics.designing.optimisation.stage_search import Interrupted as Interrupted
    from optics.designing.optimisation.state import (
        Row as Row,
        State as State,
        earlier_state as earlier_state,
        first_sags as first_sags,
    )
    from optics.designing.optimisation.symmetry import (
        Mirrors as Mirrors,
        mirror_axes as mirror_axes,
        symmetry_axes as symmetry_axes,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
