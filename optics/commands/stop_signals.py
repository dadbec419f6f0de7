"""Ctrl-C and SIGTERM stop a command in the same way; only the exit code and the word differ.

The library sets no signal handler.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

INTERRUPTED, TERMINATED = 130, 143


@dataclass
class Stop:
    """Whether a command was asked to stop, and by which signal."""

    requested: bool = False
    code: int = INTERRUPTED

    @property
    def word(self) -> str:
        return "terminated" if self.code == TERMINATED else "interrupted"


@contextmanager
def stop_signals() -> Iterator[Stop]:
    """Yield a Stop, and raise KeyboardInterrupt for both signals, while the context lasts.

    A signal that is ignored stays so: work in the background does not listen to Ctrl-C.
    """
    stop = Stop()

    def ask(number: int, frame: FrameType | None) -> None:
        stop.requested = True
        stop.code = TERMINATED if number == signal.SIGTERM else INTERRUPTED
        raise KeyboardInterrupt

    before = {}
    if threading.current_thread() is threading.main_thread():  # Python allows handlers only there
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, ask)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
