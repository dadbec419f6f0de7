"""The dotted keys of a problem file, such as target.distance, and which of them was meant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from functools import cache
from typing import Any, ClassVar, Protocol, get_args, get_type_hints

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


def keys_of(kind: type[Record], prefix: str = "") -> Iterator[Key]:
    """Yield every key of a record and of its tables, a table before its keys.

    prefix : of their names, "" or "table."
    """
    for f in fields(kind):
        hint = hints_of(kind)[f.name]
        yield Key(prefix + f.name, hint, f.metadata, f.default)
        table = table_of(hint)
        if table is not None:
            yield from keys_of(table, f"{prefix}{f.name}.")


def did_you_mean(key: str, kind: type[Record]) -> str:
    """Return " (did you mean KEY?)" for a key that does not exist, "" where none resembles it.

    A name that belongs to other tables is found there; else a name of the same table may be misspelt.
    """
    from difflib import get_close_matches

    table, _, name = key.rpartition(".")
    known = [k.name for k in keys_of(kind)]
    near = [k for k in known if k.rpartition(".")[2] == name]
    near = [k for k in near if k.startswith(f"{table}.")] or near
    if not near:
        beside = {k.rpartition(".")[2]: k for k in known if k.rpartition(".")[0] == table}
        near = [beside[match] for match in get_close_matches(name, beside, 1)]
    return f" (did you mean {' or '.join(near[:MOST])}?)" if near else ""
