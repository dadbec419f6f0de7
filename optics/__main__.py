"""`python -m optics`, which is the command `thbcad`: Ctrl-C ends it with one line, whenever it comes."""

from __future__ import annotations

import signal
import sys
from io import TextIOWrapper

from thbcad.early_stop import end_at_signals, ended


def entry() -> None:
    """Run the command line of this process, and end it."""
    end_at_signals()  # also of a command that is called by another name
    try:
        sys.exit(_run())
    except KeyboardInterrupt:  # once more, while the first one was answered
        ended(signal.SIGINT, None)


def _run() -> int:
    import gc  # by now Ctrl-C ends the process with one line, also among these imports

    from optics.base.runtime import collect_rarely  # the same
    from optics.interface.commands import main  # the same

    collect_rarely()
    if isinstance(sys.stdout, TextIOWrapper):  # None where it is closed
        # as stderr: a locale may lack a title's letters; the same bytes on all systems
        sys.stdout.reconfigure(errors="backslashreplace", newline="\n")
    code = main()
    gc.freeze()  # else Python searches all that is loaded three more times before it ends: 0.3 s
    return code


if __name__ == "__main__":
    entry()
