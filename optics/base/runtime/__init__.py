"""Errors, checks, messages, helper processes, and the one place that loads Dr.Jit."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from .backend import ARRAY_TYPES, PACKED, PRECISIONS, Backend, DrArray, load_backend as load_backend
    from .checks import RESOLVED, Check, Grade, Result, Subject, check_lines, checks_of, grade, verification
    from .errors import LONGEST, NumericalError, UserError, is_text, note, printable, speaking_of
    from .garbage import collect_rarely
    from .held_device import device, one_blas_thread
    from .helper_process import HelperProcess, ProcessEnded, answered, load, process_for, serve
    from .llvm import load_llvm
    from .lost_interrupts import interrupts_later, lost_interrupts_again
    from .order_free_sums import OrderFreeSums
    from .plain_numbers import plain_number
    from .progress import Phase, Progress, ProgressEvent
    from .systems import (
        POSIX,
        address_limit,
        flocked,
        limit_memory,
        limited_cores,
        machine_memory,
        peak_mb,
        usable_cores,
    )
    from .user_files import read_at_most, reading, require_file_name, require_regular_file

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
