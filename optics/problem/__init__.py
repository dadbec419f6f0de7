"""The problem file and its limits of manufacture."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.problem.limit_remedies import (
        limit_sentences as limit_sentences,
    )
    from optics.problem.manufacture_text import (
        as_data as as_data,
        manufacture_rows as manufacture_rows,
    )
    from optics.problem.manufacturing_limits import (
        Miss as Miss,
        feature_levels as feature_levels,
        limit_advice as limit_advice,
        limit_checks as limit_checks,
        limit_misses as limit_misses,
        require_limits as require_limits,
    )
    from optics.problem.problem_file import (
        load_problem as load_problem,
    )
    from optics.problem.schema import (
        FINEST_AUTO as FINEST_AUTO,
        Export as Export,
        Freeform as Freeform,
        Front as Front,
        Limits as Limits,
        Optimizer as Optimizer,
        Problem as Problem,
        Rear as Rear,
        Refinement as Refinement,
        Source as Source,
        Target as Target,
        Verify as Verify,
        base_of as base_of,
        per_level as per_level,
    )
    from optics.problem.toml_records import (
        AUTO as AUTO,
    )
    from optics.problem.toml_text import (
        commented_problem as commented_problem,
        problem_to_toml as problem_to_toml,
    )

_FILES = {
    "limit_remedies": ("limit_sentences",),
    "manufacture_text": (
        "as_data",
        "manufacture_rows",
    ),
    "manufacturing_limits": (
        "Miss",
        "feature_levels",
        "limit_advice",
        "limit_checks",
        "limit_misses",
        "require_limits",
    ),
    "problem_file": ("load_problem",),
    "schema": (
        "Export",
        "FINEST_AUTO",
        "Freeform",
        "Front",
        "Limits",
        "Optimizer",
        "Problem",
        "Rear",
        "Refinement",
        "Source",
        "Target",
        "Verify",
        "base_of",
        "per_level",
    ),
    "toml_records": ("AUTO",),
    "toml_text": (
        "commented_problem",
        "problem_to_toml",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
