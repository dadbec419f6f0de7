"""The problem file."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.scene.problem.choices import ENGINES as ENGINES, STARTS as STARTS, cannot_do as cannot_do
    from optics.scene.problem.dotted_keys import (
        Key as Key,
        keys_of as keys_of,
        lists_tables as lists_tables,
        table_of as table_of,
    )
    from optics.scene.problem.elements import (
        LensElement as LensElement,
        MirrorElement as MirrorElement,
        Placed as Placed,
    )
    from optics.scene.problem.faces_met import FaceMet as FaceMet, PathSpec as PathSpec
    from optics.scene.problem.key_changes import assignment as assignment
    from optics.scene.problem.lens_schema import (
        FINEST_AUTO as FINEST_AUTO,
        Freeform as Freeform,
        Front as Front,
        LensSpec as LensSpec,
        Optic as Optic,
        Rear as Rear,
        base_of as base_of,
        freedom_of as freedom_of,
    )
    from optics.scene.problem.problem_record import Problem as Problem, load_problem as load_problem
    from optics.scene.problem.run_schema import (
        Export as Export,
        Limits as Limits,
        Optimizer as Optimizer,
        Refinement as Refinement,
        Run as Run,
        Verify as Verify,
        per_level as per_level,
    )
    from optics.scene.problem.schema import (
        SUN as SUN,
        Source as Source,
        StopSpec as StopSpec,
        Target as Target,
    )
    from optics.scene.problem.starting_problems import commented_problem as commented_problem
    from optics.scene.problem.toml_records import AUTO as AUTO, problem_to_toml as problem_to_toml

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
