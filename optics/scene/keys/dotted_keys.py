"""The dotted keys of a problem file, such as target.distance, and which of them was meant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from functools import cache
from typing import Any, ClassVar, Protocol, get_args, get_origin, get_type_hints

MOST = 3  # keys that are proposed


class Record(Protocol):
    """A dataclass: a table of the problem file."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


@dataclass(frozen=True)
class Key:
    """One key: its dotted name, the type of its value, its limits, and its default; a table is a key too.

    default : MISSING where the key is required.
    """

    name: str
    hint: Any
    limits: Mapping[str, Any]
    default: Any = MISSING


hints_of = cache(get_type_hints)  # names of types are looked up, which takes longer than all checks


@cache
def table_of(hint: Any) -> type[Record] | None:
    """Return the record that a field holds, or None for a plain value."""
    for part in (hint, *get_args(hint)):
        if isinstance(part, type) and is_dataclass(part):
            return part
    return None


def lists_tables(hint: Any) -> bool:
    """Return whether a field holds a list of tables, [[...]] in a file."""
    return get_origin(hint) is tuple and table_of(hint) is not None


def variants_of(kind: type[Record]) -> tuple[type[Record], ...]:
    """Return the records that a table may be, by its key `kind`; itself, where there is one."""
    return tuple(getattr(kind, "kinds", {"": kind}).values())


def keys_of(kind: type[Record], prefix: str = "") -> Iterator[Key]:
    """Yield every key of a record and of its tables, a table before its keys.

    prefix : of their names, "" or "table."
    """
    told = set()
    for variant in variants_of(kind):
        for f in fields(variant):
            if f.name in told:
                continue
            told.add(f.name)
            hint = hints_of(variant)[f.name]
            yield Key(prefix + f.name, hint, f.metadata, f.default)
            table = table_of(hint)
            if table is not None:
                yield from keys_of(table, f"{prefix}{f.name}.")


def key_of(name: str, kind: type[Record]) -> Key | None:
    """Return the key of a dotted name, None where there is none.

    Keys of a table in a list follow its name, or its number from 0 on: stop.holder.position is a key of the
    table [[stop]] with name = "holder".
    """
    keys, listed = {key.name: key for key in keys_of(kind)}, _list_of(name, kind)
    if listed:
        _, _, own = name.removeprefix(listed).partition(".")
        return keys.get(listed + own)
    return keys.get(name)


def _list_of(name: str, kind: type[Record]) -> str:
    """Return what the names of keys in the same list of tables begin with, "" where there is none."""
    lists = (f"{key.name}." for key in keys_of(kind) if lists_tables(key.hint))
    return next((listed for listed in lists if name.startswith(listed)), "")


def did_you_mean(key: str, kind: type[Record]) -> str:
    """Return " (did you mean KEY?)" for a key that does not exist, "" where none resembles it.

    A name that belongs to other tables is found there; else a name of the same table may be misspelt.
    """
    from difflib import get_close_matches

    listed = _list_of(key, kind)
    if listed:
        key = listed + key.rpartition(".")[2]
    table, _, name = key.rpartition(".")
    known = [k.name for k in keys_of(kind)]
    near = [k for k in known if k.rpartition(".")[2] == name]
    near = [k for k in near if k.startswith(f"{table}.")] or near
    if not near:
        beside = {k.rpartition(".")[2]: k for k in known if k.rpartition(".")[0] == table}
        near = [beside[match] for match in get_close_matches(name, beside, 1)]
    near = [k for k in near if not _list_of(k, kind)] or near
    if listed:
        near = [k.replace(listed, f"{listed}NAME.", 1) if k.startswith(listed) else k for k in near]
    return f" (did you mean {' or '.join(near[:MOST])}?)" if near else ""
