"""Changes of single keys: dotted names with their values, also as KEY=VALUE of a command line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite
from typing import Any, get_args, get_origin

from optics.base.runtime import UserError
from optics.scene.keys.dead_ends import cannot_do
from optics.scene.keys.dotted_keys import Key, Record, did_you_mean, key_of, lists_tables, table_of
from optics.scene.keys.toml_records import AUTO
from thbcad.toml import MOST_PARTS, toml_tables


def with_changes(tables: Mapping[str, Any], changes: Mapping[str, object]) -> dict[str, Any]:
    """Return nested tables with some dotted keys changed; tables on the way that are missing are made.

    Raises UserError : a key below a value that is no table, a key of more than 16 parts, a table that is not
        in its list.
    """
    changed: dict[Any, Any] = dict(tables)
    for key, value in changes.items():
        *way, name = key.split(".", MOST_PARTS)
        if len(way) == MOST_PARTS:
            raise UserError(f"the key {key} has more than {MOST_PARTS} parts; `thbcad new` prints all keys")
        node, path = changed, ""
        for part in way:
            if path and isinstance(node, list):
                part = _number(part, node, path)
            below = node[part] if isinstance(node, list) else node.get(part)
            path = f"{path}.{part}" if path else part
            if isinstance(below, list | tuple) and all(isinstance(b, Mapping) for b in below):
                node[part] = list(below)
            elif below is not None and not isinstance(below, Mapping):
                raise UserError(f"{path} is a value, no table: there is no key {key}")
            else:
                node[part] = dict(below or {})
            node = node[part]
        if isinstance(node, list):
            raise UserError(f"{path} is a list of tables: write {path}.NAME.KEY, not {key}")
        node[name] = value
    return changed


def _number(name: str, tables: Sequence[Mapping[str, Any]], path: str) -> int:
    """Return the number of the table in a list with a name, or of one that is named by its number."""
    names = [table.get("name") or str(k) for k, table in enumerate(tables)]
    if name in names:
        return names.index(name)
    if name.isdecimal() and int(name) < len(tables):
        return int(name)
    known = f"there are {', '.join(names)}" if names else f"there is no [[{path}]]"
    raise UserError(f"there is no {path}.{name}; {known}")


def assignment(text: str, kind: type[Record]) -> tuple[str, Any]:
    """Return key and value of a text "KEY=VALUE".

    VALUE is TOML.  A text that is none stands for itself where the key takes one.

    kind : the record of the whole file.

    Raises UserError : no "=" or nothing before it, an unknown key, a value that is no TOML.
    """
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        raise UserError(f"{text!r} sets no key: write KEY=VALUE, such as target.distance=400")
    if not name:
        raise UserError(
            f"a key is missing before = in {text!r}: write KEY=VALUE, such as target.distance=400"
        )
    key = key_of(name, kind)
    if key is None and (reason := cannot_do(name) or cannot_do(value.strip("\"'"))):
        raise UserError(f"unknown key {name}; {reason}")
    if key is None:
        meant = did_you_mean(name, kind) or "; `thbcad new` prints all keys"
        raise UserError(f"unknown key {name}{meant}")
    try:
        read = toml_tables(f"value = {value}")
    except ValueError:
        read = {}
    if list(read) == ["value"]:
        return name, read["value"]
    names = key.limits["choices"] or ()
    if key.hint is str or value in names or (key.limits["auto"] and value == AUTO):
        return name, value
    raise UserError(f"{name} must be {_wanted(replace(key, name=name))}, got {value!r}")


def _wanted(key: Key) -> str:
    """Return what the value of a key must be, with an example."""
    if lists_tables(key.hint):
        return f"a list of tables, such as {key.name}=[{{KEY = VALUE}}]"
    if table_of(key.hint) is not None:
        return f"a table, such as {key.name}={{KEY = VALUE}}"
    kinds = [kind for kind in (key.hint, *get_args(key.hint)) if get_origin(kind) is tuple]
    if any(get_origin(get_args(kind)[0]) is tuple for kind in kinds):
        names = "".join(f", or {name}" for name in (key.limits["choices"] or ())[:1])
        return f"a list of rows, such as {key.name}=[[450, 1.5], [550, 1.49]]{names}"
    if kinds:
        number = "1" if get_args(kinds[0])[0] is int else "1.5"
        several = ", ".join([number] * max(len(get_args(kinds[0])), 2))
        return f"a list of numbers, such as {key.name}=[{several}]"
    if key.hint is bool:
        return "true or false"
    whole = int in (key.hint, *get_args(key.hint))
    automatic = ' or "auto"' if key.limits["auto"] else ""
    return (
        f"{'a whole number' if whole else 'a number'}{automatic}, such as {key.name}={_example(key, whole)}"
    )


def _example(key: Key, whole: bool) -> float:
    """Return a number that a key takes: its own example, its default, or one within its limits."""
    if key.limits["example"]:
        return float(key.limits["example"])
    default, high = key.default, key.limits["high"]
    if isinstance(default, int | float) and isfinite(default) and default:
        return default
    usual = 2 if whole else 2.5
    return usual if high is None or usual <= high else high / 2
