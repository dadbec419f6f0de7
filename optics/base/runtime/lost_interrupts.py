"""Interrupts that come where Python can raise nothing: they come again, or later."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer, current_thread, main_thread

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


@contextmanager
def interrupts_later() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM come at the end, where C++ code that calls Python ends the process on any error.

    Handlers that Python does not run (the default one of SIGTERM, one that is ignored) stay as they are.
    """
    came: list[int] = []
    before = {
        number: handler
        for number in (signal.SIGINT, signal.SIGTERM)
        if current_thread() is main_thread() and callable(handler := signal.getsignal(number))
    }
    try:
        for number in before:
            signal.signal(number, lambda number, _: came.append(number))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            interrupt_main(came[0])
