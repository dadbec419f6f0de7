"""What a user is told: errors, with the exit code that the command line gives them, and notes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

LONGEST = 600  # characters
CUT = " ... "


class UserError(Exception):
    """Bad input: one sentence that names the cause and the remedy.  Exit code 2.

    Whatever the input held, the message stays on one line, printable and short: of a longer one the middle
    is left out, since the file is named at the beginning and the remedy at the end.

    >>> problem.with_(**{"target.distnce": 400})
    Traceback (most recent call last):
    ...
    optics...UserError: unknown key target.distnce (did you mean target.distance?); ...
    """

    exit_code = 2

    def __init__(self, message: str) -> None:
        line = printable(message)
        if len(line) > LONGEST:
            half = (LONGEST - len(CUT)) // 2
            line = line[:half] + CUT + line[-half:]
        super().__init__(line)


class NumericalError(Exception):
    """A computation that failed on valid input.  Exit code 3.

    >>> minimise(lambda c: (np.nan, c), np.ones(1))
    Traceback (most recent call last):
    ...
    optics...NumericalError: the loss or its gradient is not finite; ...
    """

    exit_code = 3


def printable(text: str) -> str:
    """Return a text whose line ends and control characters are written as codes, which no terminal obeys."""
    return "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)


def is_text(text: str) -> bool:
    """Return whether UTF-8 can hold a text: bytes that the locale cannot read are none."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


@contextmanager
def speaking_of(subject: object) -> Iterator[None]:
    """Put a file or a key before the message of every UserError of the block."""
    try:
        yield
    except UserError as error:
        raise UserError(f"{subject}: {error}") from None


def note(sentence: str) -> None:
    """Print a note on stderr, above a bar of progress where there is one."""
    line = f"thbcad: note: {printable(sentence)}"
    if "tqdm" in sys.modules:
        from tqdm import tqdm

        tqdm.write(line, file=sys.stderr)
    else:
        print(line, file=sys.stderr)
