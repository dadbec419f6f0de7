"""Errors, checks, messages, rows of tables, and the one place that loads Dr.Jit."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.runtime.backend import (
        PACKED as PACKED,
        PRECISIONS as PRECISIONS,
        Backend as Backend,
        DrArray as DrArray,
        load_backend as load_backend,
    )
    from optics.runtime.checks import (
        Check as Check,
        verification as verification,
    )
    from optics.runtime.errors import (
        LONGEST as LONGEST,
        NumericalError as NumericalError,
        UserError as UserError,
    )
    from optics.runtime.llvm import (
        llvm_library as llvm_library,
    )
    from optics.runtime.messages import (
        check_lines as check_lines,
        note as note,
    )
    from optics.runtime.rows import (
        Row as Row,
        machine as machine,
        median_seconds as median_seconds,
        table as table,
    )

_FILES = {
    "backend": (
        "Backend",
        "DrArray",
        "PACKED",
        "PRECISIONS",
        "load_backend",
    ),
    "checks": (
        "Check",
        "verification",
    ),
    "errors": (
        "LONGEST",
        "NumericalError",
        "UserError",
    ),
    "llvm": ("llvm_library",),
    "messages": (
        "check_lines",
        "note",
    ),
    "rows": (
        "Row",
        "machine",
        "median_seconds",
        "table",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
