"""The parser of a command: options in one line each; errors, and words that are refused, in one sentence."""

from __future__ import annotations

import re
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from itertools import takewhile
from typing import Any, NoReturn

from optics.base.runtime import UserError, is_text
from optics.scene.keys import cannot_do

CHOICE = re.compile(r"invalid choice: '(\w+)'")  # of argparse
# what arguments call a path
PATHS = "PROBLEM.toml", "RESULT", "LENS", "DIR", "FILE", "FILE.png", "FILE.toml"


def require_known(words: Sequence[str], main: ArgumentParser, commands: Mapping[str, ArgumentParser]) -> None:
    """Raise UserError for an argument that is no text, an unknown command, or a long option that the command
    does not have.

    words : the arguments of the command line.  Options may be shortened, as argparse allows.
    """
    for word in words:
        if not is_text(word):
            raise UserError(
                f"the argument {word} is no text in this locale ({sys.getfilesystemencoding()}); "
                "set LC_ALL=C.UTF-8, or rename what it names"
            )
    first = words[0]
    if first not in commands and not first.startswith("-"):
        file = f" (did you mean design {first}?)" if first.endswith(".toml") else ""
        meant = file or _meant(first, commands)
        raise UserError(f"there is no command {first!r}{meant}; {main.prog} --help lists them")
    parser = commands.get(first, main)
    known = parser._option_string_actions
    for word in takewhile(lambda w: w != "--", words):
        option = word.partition("=")[0]
        if option.startswith("--") and not any(k.startswith(option) for k in known):
            meant = _meant(option, known)
            raise UserError(f"there is no option {option}{meant}; {parser.prog} --help lists them")


def require_paths(options: Namespace, command: ArgumentParser) -> None:
    """Raise UserError for a path that is empty, as a shell makes it of a variable that is not set."""
    for action in command._actions:
        if action.metavar in PATHS and getattr(options, action.dest) == "":
            name = action.option_strings[0] if action.option_strings else action.metavar
            raise UserError(f"{name} must be a path, got ''; {command.prog} --help says more")


def _meant(word: str, known: Iterable[str]) -> str:
    """Return " (did you mean WORD?)", or "" where no known word resembles it."""
    near = get_close_matches(word, known, 1)
    return f" (did you mean {near[0]}?)" if near else ""


class CommandParser(ArgumentParser):
    """A parser whose errors are UserErrors: one sentence, as all of this program's are.

    listing : text that the help shows after the description, in place of arguments and options.
    """

    listing = ""

    def format_help(self) -> str:
        if not self.listing:
            return super().format_help()
        return f"{self.format_usage()}\n{self.description}\n\n{self.listing}"

    def option(self, name: str, metavar: str | tuple[str, ...], help: str, **settings: Any) -> None:
        """Add an option with a value.  settings : as of `add_argument`."""
        self.add_argument(name, metavar=metavar, help=help, **settings)

    def repeated(self, name: str, metavar: str, help: str) -> None:
        """Add an option with a value that may be repeated: a list."""
        self.option(name, metavar, help, action="append", default=[])

    def choice(self, name: str, choices: Sequence[Any], help: str, **settings: Any) -> None:
        """Add an option, or an argument, that takes one of some values.  settings : as of `add_argument`."""
        self.add_argument(name, choices=choices, help=help, **settings)

    def switch(self, name: str, help: str) -> None:
        """Add an option without a value, which is False where it is not given."""
        self.add_argument(name, action="store_true", help=help)

    def out(self, metavar: str, help: str, **settings: Any) -> None:
        """Add --out, what is written, and --force beside it.  settings : as of `add_argument`."""
        self.option("--out", metavar, help, **settings)
        self.force()

    def force(self, does: str = "replace files that another problem or program wrote") -> None:
        """Add --force.  does : what, in words."""
        self.switch("--force", does)

    def error(self, message: str) -> NoReturn:
        choice = CHOICE.search(message)
        why = choice and cannot_do(choice[1])  # of a word like others it says nothing
        raise UserError(f"{message}; {why or f'{self.prog} --help says more'}")

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print help or version; argparse would pass over an OSError."""
        print(message, end="", file=file or sys.stderr, flush=True)
