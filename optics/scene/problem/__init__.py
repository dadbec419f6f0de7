"""The problem file."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.problem.choices import ASKED_LIGHT, ASKED_SOURCES, ENGINES, STARTS
    from optics.scene.problem.elements import MirrorElement, Placed
    from optics.scene.problem.faces_met import FaceMet
    from optics.scene.problem.lens_schema import (
        FINEST_AUTO,
        Freeform,
        Front,
        LensSpec,
        Optic,
        Rear,
        base_of,
        freedom_of,
    )
    from optics.scene.problem.problem_record import Problem, load_problem
    from optics.scene.problem.required_optics import require_free
    from optics.scene.problem.run_schema import (
        OF_PICTURES,
        OF_UNIFORM,
        Export,
        Limits,
        Optimizer,
        Refinement,
        Run,
        Verify,
        per_level,
    )
    from optics.scene.problem.source_schema import SUN, OneSource, Source, SourceArray
    from optics.scene.problem.starting_problems import answered_problem, commented_problem
    from optics.scene.problem.target_schema import MAX_PIXELS, StopSpec, Target, Zone

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
