"""Every key of the problem file as tables, from its schema."""

from __future__ import annotations

import re
from dataclasses import MISSING
from types import NoneType
from typing import Any, get_args

from optics.scene.keys import AUTO, Key, keys_of, lists_tables, table_of
from optics.scene.problem import Problem

MARK = "The site lists them."  # a paragraph of docs/problem_file.md, in whose place the list comes
UNIT = re.compile(
    r"(mm \(degrees in the far field\)|1/mm|g/cm\^3|mm|nm|g|degrees|radians|pixels|wavelengths)"
    r"(?:[,;:] |(?= )|$)"
)
KINDS = {bool: "true or false", int: "whole number", float: "number", str: "text"}


def with_keys(page: str) -> str:
    """Return the page of the problem file with a table of keys for each table of the file."""
    return page.replace(MARK, keys_text())


def keys_text() -> str:
    """Return the tables of all keys as Markdown."""
    keys = list(keys_of(Problem))
    tables = [key for key in keys if table_of(key.hint)]
    first = {table_of(key.hint): key.name for key in reversed(tables)}
    top = _table([key for key in keys if "." not in key.name and not table_of(key.hint)])
    parts = ["## The file itself", top]
    for table in tables:
        head = f"[[{table.name}]]" if lists_tables(table.hint) else f"[{table.name}]"
        parts.append(f"## {head} " + "{#" + table.name + "}")
        parts.append(_sentence(table.limits["note"]))
        here = first[table_of(table.hint)]
        if here == table.name:
            own = [k for k in keys if k.name.rpartition(".")[0] == here and not table_of(k.hint)]
            parts.append(_table(own))
        else:
            parts.append(f"The keys are those of [`{here}`](#{here}).")
    return "\n\n".join(part for part in parts if part)


def _table(keys: list[Key]) -> str:
    """Return keys as a table of Markdown; each has an anchor with its dotted name."""
    head = "| key | type | unit | default | range | meaning |\n|---|---|---|---|---|---|"
    return "\n".join([head, *(f"| {' | '.join(_cells(key))} |" for key in keys)])


def _cells(key: Key) -> list[str]:
    unit, meaning = _unit_and_meaning(key.limits["note"])
    name = f'<span id="{key.name}"></span>`{key.name.rpartition(".")[2]}`'
    kind, default = _type(key.hint, key.limits), _default(key.default)
    return [name, kind, unit, default, _range(key.limits), _sentence(meaning)]


def _unit_and_meaning(note: str) -> tuple[str, str]:
    """Return the unit that a note begins with, or "", and the rest."""
    found = UNIT.match(note)
    return (found[1], note[found.end() :].strip()) if found else ("", note)


def _type(hint: Any, limits: Any) -> str:
    kinds = get_args(hint)
    if limits["picture"]:
        return "path"
    if not kinds:
        return KINDS[hint]
    if NoneType in kinds:
        return _type(next(kind for kind in kinds if kind is not NoneType), limits)
    if str in kinds:  # a number or "auto", or a name or rows of numbers
        other = next(kind for kind in kinds if kind is not str)
        if limits["auto"]:
            return f'{KINDS[other]} or `"{AUTO}"`'
        return f"name, or {KINDS.get(other, 'rows of numbers')}"
    if get_args(kinds[0]):
        return f"rows of {len(get_args(kinds[0]))} numbers"
    if kinds[-1] is Ellipsis:
        return f"{KINDS[kinds[0]]}, or a list of them"
    return f"list of {len(kinds)} {KINDS[kinds[0]]}s"


def _default(value: Any) -> str:
    if value is None:
        return "left out"
    return "**required**" if value is MISSING else f"`{_toml(value)}`"


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    return f"[{', '.join(map(_toml, value))}]" if isinstance(value, tuple) else f"{value!r}"


def _range(limits: Any) -> str:
    """Return the limits of a key in words."""
    if limits["choices"]:
        return ", ".join(f'`"{name}"`' for name in limits["choices"])
    words = [
        f"{word} {limits[name]:g}"
        for name, word in (("low", "at least"), ("above", "above"), ("high", "at most"))
        if limits[name] is not None
    ]
    if limits["size"]:
        low, high = limits["size"]
        words.append(f"from {low:g} to {high:g} in size" if low else f"at most {high:g} in size")
    words += ["or 0"] * bool(limits["zero"] and limits["low"]) + ["or `inf`"] * limits["infinite"]
    return ", ".join(words)


def _sentence(note: str) -> str:
    """Return a note as a sentence in a cell."""
    text = note.replace("|", "\\|").replace("[[", "\\[[").replace("*", "\\*").strip()
    return text[:1].upper() + text[1:] + "." * bool(text)
