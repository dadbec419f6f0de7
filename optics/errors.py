"""Errors with the exit code that the command line gives them."""

from __future__ import annotations


class UserError(Exception):
    """Bad input: one sentence that names the cause and the remedy.  Exit code 2."""

    exit_code = 2


class NumericalError(Exception):
    """A computation that failed on valid input.  Exit code 3."""

    exit_code = 3
