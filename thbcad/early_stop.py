"""Ctrl-C and SIGTERM end the command with one line, from its first import on.

Python raises KeyboardInterrupt wherever it is, also among the imports of the command line and while it ends,
and prints a traceback.  As long as `commands.stop_signals` does not listen there is nothing to tidy up: the
process ends at once.  This file imports next to nothing, and the package imports it first.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from types import FrameType

WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
NAMES = {f"thbcad{end}" for end in ("", ".exe", "-script.py")}  # of the installed command


def is_command() -> bool:
    """Return whether this process runs the command line: scripts keep their own handlers of signals."""
    name = os.path.basename(sys.argv[0]) if sys.argv else ""
    before = sys.orig_argv[1 : 1 + len(sys.orig_argv) - len(sys.argv) + 1]
    by_module = name == "-m" and not {"optics", "thbcad"}.isdisjoint(before)
    return by_module or name in NAMES


def end_at_signals() -> None:
    """End this process with one line at the next signal; signals that are ignored stay so."""
    for number in WORDS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # work in the background does not listen
            signal.signal(number, ended)
            atexit.register(signal.signal, number, signal.SIG_IGN)  # registered first, called last: Python
            # takes its handlers back while it ends, and a signal would replace the code of what is done


def ended(number: int, frame: FrameType | None) -> None:
    """End the process with one line; 130 or 143, as shells have it."""
    try:
        os.write(2, f"thbcad: {WORDS[signal.Signals(number)]}\n".encode())
    finally:  # also where stderr is closed
        os._exit(128 + number)


if is_command():
    end_at_signals()
