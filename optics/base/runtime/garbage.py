"""Memory that is no longer needed: how often Python looks for it, and when the system gets it back."""

from __future__ import annotations

import ctypes
import gc
import sys

RARELY = (100_000, 20, 100)  # new objects until a search, and searches of one generation per one of the next


def collect_rarely() -> None:
    """Make a process of one command search rarely.

    Commands make few circles, and Python searches all loaded packages for them: 0.3 s of a design.
    """
    gc.set_threshold(*RARELY)


def give_back_memory() -> None:
    """Give memory that this process no longer uses back to the system.

    The C library keeps what is free below what is used; glibc can be asked for it.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)


def collect_and_give_back() -> None:
    """Look for circles among the objects of the last work, such as figures, and give memory back."""
    gc.collect(1)
    give_back_memory()
