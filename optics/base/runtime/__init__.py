"""Errors, checks, messages, helper processes, and the one place that loads Dr.Jit."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from .backend import (
        ARRAY_TYPES as ARRAY_TYPES,
        PACKED as PACKED,
        PRECISIONS as PRECISIONS,
        Backend as Backend,
        DrArray as DrArray,
        load_backend as load_backend,
        usable_cores as usable_cores,
    )
    from .checks import (
        RESOLVED as RESOLVED,
        Check as Check,
        Grade as Grade,
        Result as Result,
        check_lines as check_lines,
        checks_of as checks_of,
        grade as grade,
        verification as verification,
    )
    from .errors import (
        LONGEST as LONGEST,
        NumericalError as NumericalError,
        UserError as UserError,
        is_text as is_text,
        note as note,
        printable as printable,
        speaking_of as speaking_of,
    )
    from .garbage import collect_rarely as collect_rarely
    from .helper_process import (
        HelperProcess as HelperProcess,
        ProcessEnded as ProcessEnded,
        load as load,
        peak_mb as peak_mb,
        process_for as process_for,
        serve as serve,
    )
    from .llvm import llvm_library as llvm_library
    from .lost_interrupts import lost_interrupts_again as lost_interrupts_again
    from .order_free_sums import OrderFreeSums as OrderFreeSums
    from .progress import Phase as Phase, Progress as Progress, ProgressEvent as ProgressEvent
    from .user_files import (
        read_at_most as read_at_most,
        reading as reading,
        require_regular_file as require_regular_file,
    )

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
