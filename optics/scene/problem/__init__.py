"""The problem file."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.scene.problem.choices import ASKED_LIGHT, ASKED_SOURCES, ENGINES, STARTS, cannot_do
    from optics.scene.problem.dotted_keys import Key, keys_of, lists_tables, table_of
    from optics.scene.problem.elements import LensElement, MirrorElement, Placed
    from optics.scene.problem.faces_met import FaceMet, PathSpec
    from optics.scene.problem.key_changes import assignment
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
    from optics.scene.problem.run_schema import Export, Limits, Optimizer, Refinement, Run, Verify, per_level
    from optics.scene.problem.schema import SUN, OneSource, Source, SourceArray, StopSpec, Target, Zone
    from optics.scene.problem.starting_problems import answered_problem, commented_problem
    from optics.scene.problem.toml_records import AUTO, problem_to_toml

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
