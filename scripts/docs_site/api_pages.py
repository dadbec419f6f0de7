"""A page for each room with the names that its door offers."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from scripts.docs_site.outside_files import ROOT

PACKAGES = ("thbcad", "optics")
MARK = "The site lists them."  # a paragraph of docs/api.md, in whose place the list comes


@dataclass(frozen=True)
class Room:
    """A package with a door.

    names : {name: (the room that defines it, its whole dotted name)}.
    """

    module: str
    sentence: str
    names: dict[str, tuple[str, str]]

    @property
    def page(self) -> str:
        """The place of its page."""
        return f"api/{self.module}.md"

    def text(self) -> str:
        """Return its page: its own names as entries of mkdocstrings, names of other rooms as links."""
        lines = [f"# {self.module}", self.sentence]
        others = [
            f"| [`{name}`][{home}] | `{room}` |"
            for name, (room, home) in self.names.items()
            if room != self.module
        ]
        if others:
            lines.append("\n".join(["| name | room |", "|---|---|", *others]))
        lines += [f"::: {home}" for room, home in self.names.values() if room == self.module]
        return "\n\n".join(lines) + "\n"


@cache
def rooms() -> list[Room]:
    """Return all rooms, as the tables of their doors tell; nothing is imported."""
    doors = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("__init__.py"))]
    return [_room(door) for door in doors if "lazy_door" in door.read_text("utf-8")]  # wings have no door


def overview() -> str:
    """Return the rooms with their sentences as a table."""
    rows = [f"| [`{room.module}`]({room.page}) | {room.sentence} |" for room in rooms()]
    return "\n".join(["| room | what lives there |", "|---|---|", *rows])


def _room(door: Path) -> Room:
    module = ".".join(door.parent.relative_to(ROOT).parts)
    sentence = (ast.get_docstring(ast.parse(door.read_text("utf-8"))) or "").split("\n\n")[0]
    names = {name: _home(door.parent, file, name) for file, held in _table(door).items() for name in held}
    return Room(module, " ".join(sentence.split()), names)


def _home(room: Path, file: str, name: str) -> tuple[str, str]:
    """Return the room that defines a name of a door, and its whole dotted name."""
    inner = room.joinpath(*file.split("."))
    if inner.is_dir():
        held = next(file for file, names in _table(inner / "__init__.py").items() if name in names)
        return _home(inner, held, name)
    return ".".join(room.relative_to(ROOT).parts), _definition(inner.with_suffix(".py"), name)


def _definition(path: Path, name: str) -> str:
    """Return the whole dotted name of what a file defines, or has from another file."""
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module and name in [a.name for a in node.names]:
            return f"{node.module}.{name}"
    return f"{'.'.join(path.relative_to(ROOT).with_suffix('').parts)}.{name}"


def _table(door: Path) -> dict[str, list[str]]:
    """Return the names of a door by file."""
    start = len(door.parent.relative_to(ROOT).parts)
    for node in ast.parse(door.read_text("utf-8")).body:
        if isinstance(node, ast.If):
            imports = [n for n in node.body if isinstance(n, ast.ImportFrom) and n.module]
            return {
                ".".join(n.module.split(".")[0 if n.level else start :]): [a.name for a in n.names]
                for n in imports
                if n.module
            }
    raise ValueError(f"{door} offers nothing")
