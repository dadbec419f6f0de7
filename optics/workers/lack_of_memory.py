"""Whether an error comes from a lack of memory, whatever it is called."""

from __future__ import annotations

DRJIT_WORDS = ("out of memory", "could not allocate")  # of Dr.Jit 1.5: jit_malloc and jit_llvm_compile


def lacks_memory(error: BaseException | None) -> bool:
    """Return whether an error, or one that it follows from, is a lack of memory.

    Dr.Jit says its own in a RuntimeError.  An operation of ours that fails inside Dr.Jit becomes another one,
    whose cause is the error.
    """
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        if isinstance(error, RuntimeError) and any(words in str(error) for words in DRJIT_WORDS):
            return True
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return False
