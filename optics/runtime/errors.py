"""Errors with the exit code that the command line gives them."""

from __future__ import annotations

LONGEST = 600  # characters


class UserError(Exception):
    """Bad input: one sentence that names the cause and the remedy.  Exit code 2.

    Whatever the input held, the message stays on one line, printable and short.
    """

    exit_code = 2

    def __init__(self, message: str) -> None:
        line = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in message)
        super().__init__(line if len(line) <= LONGEST else line[: LONGEST - 3] + "...")


class NumericalError(Exception):
    """A computation that failed on valid input.  Exit code 3."""

    exit_code = 3
