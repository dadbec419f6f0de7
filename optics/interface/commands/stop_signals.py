"""Ctrl-C and SIGTERM stop a command in the same way; only the exit code and the word differ.

The library sets no signal handler.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from types import FrameType

from optics.base.runtime import lost_interrupts_again


@dataclass
class Stop:
    """Whether a command was asked to stop, and by which signal."""

    requested: bool = False
    number: int = signal.SIGINT

    @property
    def code(self) -> int:
        """The exit code: 130 or 143, as shells have it."""
        return 128 + self.number

    @property
    def word(self) -> str:
        return "terminated" if self.number == signal.SIGTERM else "interrupted"


@contextmanager
def stop_signals() -> Iterator[Stop]:
    """Yield a Stop, and raise KeyboardInterrupt for both signals, while the context lasts.

    A signal that is ignored stays so: work in the background does not listen to Ctrl-C.
    """
    stop = Stop()

    def ask(number: int, frame: FrameType | None) -> None:
        stop.requested, stop.number = True, number
        raise KeyboardInterrupt

    before = {}
    if threading.current_thread() is threading.main_thread():  # Python allows handlers only there
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, ask)
    try:
        with lost_interrupts_again(lambda: stop.number) if before else nullcontext():
            yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
