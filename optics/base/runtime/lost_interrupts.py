"""Interrupts that come where Python can raise nothing: they come again."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer

from optics.base.runtime.systems import interrupt_main

LATER = 0.01  # seconds


@contextmanager
def lost_interrupts_again(number: Callable[[], int]) -> Iterator[None]:
    """Send a signal again, and print nothing, where the KeyboardInterrupt that it raised was lost.

    Python drops what is raised while the callback of a weak reference or a `__del__` runs, for want of a
    caller: the work would go on as if nobody had stopped it.

    number : returns that of the signal
    """
    before, timers = sys.unraisablehook, list[Timer]()

    def hook(lost: sys.UnraisableHookArgs) -> None:
        if issubclass(lost.exc_type, KeyboardInterrupt):
            timers.append(Timer(LATER, interrupt_main, (number(),)))
            timers[-1].start()
        else:
            before(lost)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before
        for timer in timers:  # what was to be stopped has ended
            timer.cancel()
