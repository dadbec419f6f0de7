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
    """By which signal a command was stopped."""

    code: int = INTERRUPTED

    @property
    def word(self) -> str:
        return "terminated" if self.code == TERMINATED else "interrupted"


@contextmanager
def stop_signals() -> Iterator[Stop]:
    """Yield a Stop, and raise KeyboardInterrupt for SIGTERM too, while the context lasts."""
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():  # Python allows handlers only there
        yield stop
        return

    def terminate(number: int, frame: FrameType | None) -> None:
        stop.code = TERMINATED
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGTERM, before)
