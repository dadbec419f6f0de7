"""The parser of a command: options in one line each, errors in one sentence."""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from typing import Any, NoReturn

from optics.base.runtime import UserError
from optics.interface.commands.known_words import refused_choice


class CommandParser(ArgumentParser):
    """A parser whose errors are UserErrors: one sentence, as all of this program's are."""

    def option(self, name: str, metavar: str, help: str, **settings: Any) -> None:
        """Add an option with a value.  settings : as of `add_argument`."""
        self.add_argument(name, metavar=metavar, help=help, **settings)

    def switch(self, name: str, help: str) -> None:
        """Add an option without a value, which is False where it is not given."""
        self.add_argument(name, action="store_true", help=help)

    def error(self, message: str) -> NoReturn:
        raise UserError(f"{message}; {refused_choice(message) or f'{self.prog} --help says more'}")

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print help or version; argparse would pass over an OSError."""
        print(message, end="", file=file or sys.stderr, flush=True)
