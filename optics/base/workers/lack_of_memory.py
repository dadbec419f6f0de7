"""Whether an error comes from a lack of memory, whatever it is called."""

from __future__ import annotations

from errno import ENOMEM

from optics.base.runtime import address_limit

NO_THREAD = "can't start new thread"  # of Python: each takes memory for its stack, and counts as a process
# of Python itself, where a limit of memory ends the compiling of a module
NO_WORD = "without exception set", "without setting an exception"
WORDS = {
    RuntimeError: ("out of memory", "could not allocate"),  # of Dr.Jit 1.5: jit_malloc and jit_llvm_compile
    ImportError: ("failed to map segment", "cannot allocate memory"),  # of the loader of packages
}


def lacks_memory(error: BaseException | None) -> bool:
    """Return whether an error, or one that it follows from, is a lack of memory.

    Dr.Jit says its own in a RuntimeError.  An operation of ours that fails inside Dr.Jit becomes another one,
    whose cause is the error.
    """
    while error is not None:
        if isinstance(error, MemoryError) or getattr(error, "errno", None) == ENOMEM:
            return True
        limited = address_limit() is not None
        if isinstance(error, SystemError) and any(word in str(error) for word in NO_WORD) and limited:
            return True
        if isinstance(error, RuntimeError) and NO_THREAD in str(error) and limited:
            return True
        for kind, words in WORDS.items():
            if isinstance(error, kind) and any(word in str(error) for word in words):
                return True
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return False
