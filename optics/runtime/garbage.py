"""How often Python looks for objects that refer to each other in a circle."""

from __future__ import annotations

import gc

RARELY = (100_000, 20, 100)  # new objects until a search, and searches of one generation per one of the next


def collect_rarely() -> None:
    """Make a process of one command search rarely.

    Commands make few circles, and Python searches all loaded packages for them: 0.3 s of a design.
    """
    gc.set_threshold(*RARELY)
