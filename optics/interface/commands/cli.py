"""The command line.

Results go to stdout (--json for machines), progress and messages to stderr (--quiet: errors alone).  Nothing
ends because stderr is closed or cannot be written.
Exit codes: 0 done, 1 the light misses what was asked for or that is not decided, 2 bad input, 3 numerical
failure, 4 the file, a part or a limit of making fails, 70 internal error, 130 interrupted, 143 terminated.
"""

from __future__ import annotations

import os
import re
import sys
import traceback
from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, suppress
from ctypes import pythonapi
from importlib import import_module
from typing import Any, TextIO

from optics.base.runtime import NumericalError, UserError, address_limit, printable
from optics.base.workers import lacks_memory
from optics.interface.commands.arguments import parsed
from optics.interface.commands.outcome import Outcome
from optics.interface.commands.stop_signals import stop_signals
from optics.interface.screens import full_text, screen_text
from thbcad.doors import MissingPackage, missing_packages, not_installed, require_one_occt
from thbcad.io import json_text

INTERNAL_ERROR = 70  # EX_SOFTWARE of sysexits.h
FREE = ("export", "new")  # commands that need no more than their file does, and say what that lacks
DATE = "SOURCE_DATE_EPOCH"  # environment variable of reproducible builds, which numpy and matplotlib read
DIGITS = re.compile("[0-9]{1,12}")
LATEST = 253402300799  # the end of the year 9999
DEBUG = "THBCAD_DEBUG"  # environment variable: set, every error shows its traceback


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code."""
    options = None
    with _messages():
        try:
            with _printing():
                options = parsed(sys.argv[1:] if arguments is None else arguments)
        except (UserError, OSError) as error:
            return _failed(error, False)
        return 0 if options is None else _stoppable(options)


def _stoppable(options: Namespace) -> int:
    """Run the command of the arguments, and return the exit code also where it fails or is stopped."""
    # as `one_blas_thread`; no other is begun at all, since a process with threads forbids copies of itself
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ["MPLBACKEND"] = "agg"  # pictures are written, never shown
    with stop_signals() as stop:
        try:
            return _run(options)
        except BaseException as error:
            # a package that a signal stops while it is loaded ends with another error
            if stop.requested or isinstance(error, KeyboardInterrupt):
                print(f"thbcad: {stop.word}", file=sys.stderr)
                # CPython marks an interrupt that ends code run from C, as packages do while they are loaded,
                # as unhandled, and would end by SIGINT; the next code of this kind takes the mark away
                pythonapi.PyRun_SimpleString(b"")
                return stop.code
            if isinstance(error, Exception):
                return _failed(error, options.verbose)
            raise


def _run(options: Namespace) -> int:
    """Run the command of the arguments, print what it returns, and return the exit code."""
    _require_date()
    if options.command not in FREE:
        if missing := missing_packages("optics"):
            raise UserError(not_installed(missing, "optics"))
        require_one_occt()
    command = import_module(f"optics.interface.commands.{options.command}_command")
    with ExitStack() as stack:
        if options.quiet:  # an error that ends the command is told behind it
            stack.enter_context(redirect_stderr(stack.enter_context(open(os.devnull, "w"))))
        outcome: Outcome = getattr(command, options.command)(options)
    with _printing():
        print(json_text(outcome.data) if options.json else _text(outcome, options), flush=True)
    return outcome.code


def _text(outcome: Outcome, options: Namespace) -> str:
    """Return what a command prints: its screen, with all lines after it for --full, or its lines alone."""
    if outcome.screen is None:
        return "\n".join(map(printable, outcome.lines))
    shown = screen_text(outcome.screen, sys.stdout)
    if not (options.full or getattr(options, "explain", False)):
        return shown
    return f"{shown}\n\n{full_text(outcome.lines, sys.stdout).lstrip()}"


def _require_date() -> None:
    """Raise UserError where the environment holds a date that packages cannot read while they are loaded."""
    date = os.environ.get(DATE)
    if date is not None and not (DIGITS.fullmatch(date) and int(date) <= LATEST):
        raise UserError(
            f"the environment variable {DATE} must be whole seconds since 1970, from 0 to {LATEST}, got "
            f"{date[:20]!r}; unset it"
        )


def _failed(error: Exception, verbose: bool) -> int:
    """Say in one sentence why a command failed, and return the exit code.

    verbose : whether the traceback is shown too, where the input is not to blame
    """
    if isinstance(error, UserError | NumericalError):
        sentence, code = str(error), error.exit_code
    elif isinstance(error, MissingPackage):
        sentence, code = str(error), UserError.exit_code
    elif lacks_memory(error):
        most = address_limit()
        limit = "" if most is None else f"raise its limit (ulimit -v {most >> 10}), or "
        sentence = f"out of memory; {limit}use fewer pixels, rays or levels"
        code = NumericalError.exit_code
    elif isinstance(error, RuntimeError) and "can't start new thread" in str(error):
        sentence = (
            "the system starts no more threads; raise the limit of processes (ulimit -u), or end others"
        )
        code = NumericalError.exit_code
    elif isinstance(error, OSError):
        where = f" {error.filename}" if error.filename else ""
        sentence = str(UserError(f"cannot write or read{where}: {error.strerror or error}"))
        code = UserError.exit_code
    else:
        what = UserError(f"internal error: {type(error).__name__}: {error}")
        sentence = f"{what}; please report it with the traceback that --verbose shows"
        code = INTERNAL_ERROR
    if os.environ.get(DEBUG) or (verbose and not isinstance(error, UserError)):
        traceback.print_exception(error)
    print(f"thbcad: {sentence}", file=sys.stderr)
    return code


@contextmanager
def _printing() -> Iterator[None]:
    """Print to stdout in the block; a reader that has gone (`| head`) ends the block, and is no error."""
    try:
        yield
    except OSError as error:
        _drop(sys.stdout)
        if not isinstance(error, BrokenPipeError):
            raise UserError(f"cannot print to stdout: {error.strerror}; what was written stays") from None


class _Forgiving:
    """A stream that goes on where it cannot be written."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError):
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def _messages() -> Iterator[None]:
    """Let what the block says on stderr fall silent where that is closed or cannot be written."""
    with ExitStack() as stack:
        stream = sys.stderr
        if stream is None:  # closed by `2>&-`
            stream = stack.enter_context(open(os.devnull, "w"))
            # takes the free descriptor 2, also for helper processes: what C libraries print reaches no file
            os.set_inheritable(stream.fileno(), True)
        forgiving: Any = _Forgiving(stream)
        stack.enter_context(redirect_stderr(forgiving))
        try:
            yield
        finally:
            try:
                stream.flush()
            except OSError:
                _drop(stream)


def _drop(stream: TextIO) -> None:
    """Send nowhere what a stream still holds: Python writes it at its end, and would end with code 120."""
    with suppress(OSError), open(os.devnull, "w") as nowhere:  # a stream in memory has no descriptor
        os.dup2(nowhere.fileno(), stream.fileno())
