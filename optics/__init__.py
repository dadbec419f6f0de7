"""Illumination optics on exact spline surfaces, for scripts.

    problem = optics.load_problem("pearl.toml")
    design = optics.design(problem, progress=True)
    design.save("exports/pearl")

Names are loaded when they are first used: ``import optics`` itself loads nothing heavy.
"""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .base.optimisers import (
        LBFGS as LBFGS,
        Adam as Adam,
        GradientDescent as GradientDescent,
        LineSearch as LineSearch,
        Momentum as Momentum,
        Optimiser as Optimiser,
        RMSProp as RMSProp,
    )
    from .base.runtime import NumericalError as NumericalError, UserError as UserError
    from .interface.api import (
        Design as Design,
        Minimum as Minimum,
        Model as Model,
        System as System,
        design as design,
        form_tolerances as form_tolerances,
        minimise as minimise,
        mitsuba_scene as mitsuba_scene,
        monte_carlo as monte_carlo,
        tolerances as tolerances,
    )
    from .interface.sweeps import Sweep as Sweep, SweepRow as SweepRow, sweep as sweep
    from .scene.problem import (
        Export as Export,
        Freeform as Freeform,
        Front as Front,
        LensSpec as LensSpec,
        Limits as Limits,
        Optimizer as Optimizer,
        Problem as Problem,
        Rear as Rear,
        Refinement as Refinement,
        Run as Run,
        Source as Source,
        StopSpec as StopSpec,
        Target as Target,
        Verify as Verify,
        Zone as Zone,
        load_problem as load_problem,
    )
    from .tolerancing.machining import ToolOrder as ToolOrder

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__, public=True)
