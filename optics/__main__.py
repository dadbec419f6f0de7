"""`python -m optics` and the installed command: Ctrl-C ends it with one line, whenever it comes.

Python raises KeyboardInterrupt wherever it is, also among the imports of the command line and while it ends,
and prints a traceback.  As long as `commands.stop_signals` does not listen there is nothing to tidy
up: the process ends at once.  This file imports next to nothing.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from io import TextIOWrapper
from types import FrameType

WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}


def entry() -> None:
    """Run the command line of this process, and end it."""
    for number in WORDS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # work in the background does not listen
            signal.signal(number, _ended)
            atexit.register(signal.signal, number, signal.SIG_IGN)  # registered first, called last: Python
            # takes its handlers back while it ends, and a signal would replace the code of what is done
    try:
        sys.exit(_run())
    except KeyboardInterrupt:  # once more, while the first one was answered
        _ended(signal.SIGINT, None)


def _run() -> int:
    import gc

    from optics.base.runtime import collect_rarely  # by now Ctrl-C ends the process with one line
    from optics.interface.commands import main  # the same

    collect_rarely()
    if isinstance(sys.stdout, TextIOWrapper):  # None where it is closed
        # as stderr: a locale may lack a title's letters; the same bytes on all systems
        sys.stdout.reconfigure(errors="backslashreplace", newline="\n")
    code = main()
    gc.freeze()  # else Python searches all that is loaded three more times before it ends: 0.3 s
    return code


def _ended(number: int, frame: FrameType | None) -> None:
    """End the process with one line; 130 or 143, as shells have it."""
    try:
        os.write(2, f"thbcad: {WORDS[signal.Signals(number)]}\n".encode())
    finally:  # also where stderr is closed
        os._exit(128 + number)


if __name__ == "__main__":
    entry()
