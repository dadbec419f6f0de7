"""The command line.

Results go to stdout (--json for machines), progress and messages to stderr.  Exit codes:
0 done, 1 a check failed, 2 bad input, 3 numerical failure, 70 internal error, 130 interrupted.
"""

from __future__ import annotations

import gc
import os
import sys
import traceback
from collections.abc import Sequence
from importlib import import_module

from optics.commands.arguments import parser
from optics.commands.outcome import Outcome
from optics.runtime import NumericalError, UserError, collect_rarely, printable
from thbcad.doors import missing_packages, pip_command

INTERNAL_ERROR = 70  # EX_SOFTWARE of sysexits.h
DEBUG = "THBCAD_DEBUG"  # environment variable: set, an internal error shows its traceback


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code."""
    options = parser().parse_args(arguments)
    # only vector operations use BLAS here: its threads would wait for each other, not help
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        _require_extra()
        command = import_module(f"optics.commands.{options.command}_command")
        outcome: Outcome = getattr(command, options.command)(options)
    except (UserError, NumericalError) as error:
        print(f"thbcad: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("thbcad: interrupted", file=sys.stderr)
        return 130
    except ImportError as error:
        if not isinstance(error.__cause__, KeyboardInterrupt):  # Ctrl-C while OCP is loaded
            return _internal(error)
        print("thbcad: interrupted", file=sys.stderr)
        return 130
    except MemoryError:
        print("thbcad: out of memory; use fewer pixels, rays or levels", file=sys.stderr)
        return NumericalError.exit_code
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        print(
            f"thbcad: {UserError(f'cannot write or read{where}: {error.strerror or error}')}", file=sys.stderr
        )
        return UserError.exit_code
    except Exception as error:
        return _internal(error)
    from thbcad.io import json_text

    lines = "\n".join(outcome.lines).split("\n")
    _print(json_text(outcome.data) if options.json else "\n".join(map(printable, lines)))
    return 0 if outcome.ok else 1


def _internal(error: Exception) -> int:
    """Tell of an error of this program itself, and return the exit code."""
    if os.environ.get(DEBUG):
        traceback.print_exception(error)
    what = UserError(f"internal error: {type(error).__name__}: {error}")
    print(f"thbcad: {what}; please report it with the traceback that {DEBUG}=1 shows", file=sys.stderr)
    return INTERNAL_ERROR


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
