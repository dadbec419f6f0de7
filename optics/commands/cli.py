"""The command line.

Results go to stdout (--json for machines), progress and messages to stderr.  Exit codes:
0 done, 1 a check failed, 2 bad input, 3 numerical failure, 130 interrupted, 143 terminated.
"""

from __future__ import annotations

import gc
import os
import sys
from argparse import Namespace
from collections.abc import Sequence
from importlib import import_module

from optics.commands.arguments import parser
from optics.commands.outcome import Outcome
from optics.commands.stop_signals import Stop, stop_signals
from optics.runtime import NumericalError, UserError, collect_rarely
from thbcad.doors import missing_packages, pip_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code."""
    options = parser().parse_args(arguments)
    # only vector operations use BLAS here: its threads would wait for each other, not help
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with stop_signals() as stop:
        return _run(options, stop)


def _run(options: Namespace, stop: Stop) -> int:
    """Run the command of the arguments and return the exit code."""
    try:
        _require_extra()
        command = import_module(f"optics.commands.{options.command}_command")
        outcome: Outcome = getattr(command, options.command)(options)
    except (UserError, NumericalError) as error:
        print(f"thbcad: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return _stopped(stop)
    except ImportError as error:
        if not isinstance(error.__cause__, KeyboardInterrupt):  # Ctrl-C while OCP is loaded
            raise
        return _stopped(stop)
    except MemoryError:
        print("thbcad: out of memory; use fewer pixels, rays or levels", file=sys.stderr)
        return NumericalError.exit_code
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        print(f"thbcad: cannot write or read{where}: {error.strerror or error}", file=sys.stderr)
        return UserError.exit_code
    from thbcad.io import json_text

    _print(json_text(outcome.data) if options.json else "\n".join(outcome.lines))
    return 0 if outcome.ok else 1


def _stopped(stop: Stop) -> int:
    print(f"thbcad: {stop.word}", file=sys.stderr)
    return stop.code


def _require_extra() -> None:
    """Raise UserError unless everything that the commands need is installed; help needs none of it."""
    missing = missing_packages("optics")
    if missing:
        verb = "is" if len(missing) == 1 else "are"
        raise UserError(f"{', '.join(missing)} {verb} not installed; {pip_command('optics')}")


def _print(text: str) -> None:
    """Print to stdout; a reader that has gone (`| head`) is no error."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def entry() -> None:
    """Entry point of the installed command."""
    collect_rarely()
    code = main()
    gc.freeze()  # else Python searches all that is loaded three more times before it ends: 0.3 s
    sys.exit(code)
