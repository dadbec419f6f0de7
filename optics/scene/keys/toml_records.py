"""Records from tables, of TOML files or of code: every key and value checked.

Unknown keys, wrong types and impossible numbers are UserErrors that name the key.
"""

from __future__ import annotations

import math
import os
import re
import reprlib
from collections.abc import Mapping
from dataclasses import MISSING, field, fields
from numbers import Integral, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, get_args, get_origin

from optics.base.runtime import UserError, is_text
from optics.scene.keys.dead_ends import cannot_do
from optics.scene.keys.dotted_keys import Record, did_you_mean, hints_of, lists_tables, table_of

Kind = TypeVar("Kind", bound=Record)
Rows = tuple[tuple[float, float], ...]

AUTO = "auto"  # of a number that the program chooses
SHORTEST = 1e-6  # mm: a nanometre, less than CAD kernels tell apart
LONGEST = 1e6  # mm: a kilometre
FARTHEST = 1e9  # mm, of the planes before and behind the lens
MOST_ROWS = 10_000  # of a table of numbers
MOST_TABLES = 1000  # in a list
NAME = re.compile(r"[A-Za-z][\w-]*")  # of a table in a list: no dots, and no number, which counts them
LARGEST = 2**63 - 1  # whole numbers, the range that TOML guarantees


def option(
    default: Any = MISSING,
    choices: tuple[str, ...] | None = None,
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    size: tuple[float, float] | None = None,
    note: str = "",
    infinite: bool = False,
    picture: bool = False,
    auto: bool = False,
    zero: bool = False,
    only: Mapping[str, tuple[object, ...]] | None = None,
    instead: str = "",
    example: float | None = None,
) -> Any:
    """Return a field with its limits and a note; a key without a default is required.

    size : limits of the absolute value.  infinite : inf is allowed too.
    picture : the value is the path of a picture.  auto : the number may be left to the program.
    zero : 0 is allowed too.
    only : {another key: its values} with which alone this key has an effect; see `require_effects`.
    example : of a number, for messages; None is the default, or one within the limits.
    instead : the key to set where this one has no effect, if there is one.
    """
    limits: dict[str, Any] = dict(choices=choices, low=low, high=high, above=above, size=size, note=note)
    limits |= dict(infinite=infinite, picture=picture, auto=auto, zero=zero)
    limits |= dict(only=only or {}, instead=instead, example=example)
    return field(default=default, metadata=limits)


def record(kind: type[Kind], data: object, folder: Path | None = None) -> Kind:
    """Return the tables of a problem as a record; every key and value is checked.

    folder : see `checked_values`, which also raises.
    """
    return kind(**checked_values(kind, data, folder))


def checked_values(
    kind: type[Record],
    data: object,
    folder: Path | None = None,
    prefix: str = "",
    root: type[Record] | None = None,
) -> dict[str, Any]:
    """Return the fields of a record from a table, each checked against its options.

    data : a table, or such a record, whose values are checked likewise.
    folder : what relative paths of pictures start from; None leaves them as they are.
    prefix : of the keys in messages, "" or "table."
    root : the record of the whole file, whose keys are proposed for unknown ones; None is this one.

    Raises UserError : an unknown or missing key, a value of another type or beyond its limits.
    """
    if isinstance(data, kind):
        data = {f.name: getattr(data, f.name) for f in fields(kind)}
    if isinstance(data, list | tuple) and prefix:
        name = prefix.rstrip(".")
        more = f"; {reason}" if (reason := cannot_do(f"{name}s")) else ""
        raise UserError(f"{name} must be a table, [{name}], and there is one; got {_brief(data)}{more}")
    if not isinstance(data, Mapping):
        raise UserError(f"{prefix.rstrip('.')} must be a table, got {_brief(data)}")
    root = root or kind
    known = [f.name for f in fields(kind)]
    for key in data:
        if key not in known:
            if reason := cannot_do(f"{prefix}{key}") or cannot_do(data[key]):
                raise UserError(f"unknown key {prefix}{key}; {reason}")
            others = getattr(kind, "kinds", {}).items()
            if owners := [name for name, other in others if key in {f.name for f in fields(other)}]:
                raise UserError(
                    f'unknown key {prefix}{key}: it is that of kind = "{owners[0]}"; leave it out'
                )
            meant = did_you_mean(re.sub(r"\[\d+\]", "", f"{prefix}{key}"), root)
            where = f"[{prefix.rstrip('.')}]" if prefix else "the top level"
            raise UserError(f"unknown key {prefix}{key}{meant}; {where} takes {', '.join(known)}")
    values: dict[str, Any] = {}
    for f in fields(kind):
        key, hint = prefix + f.name, hints_of(kind)[f.name]
        if f.name not in data:
            if f.default is MISSING:
                note = f" ({f.metadata['note']})" if f.metadata["note"] else ""
                raise UserError(f"the key {key} is missing{note}; add it")
            continue
        value, table = data[f.name], table_of(hint)
        if NoneType in get_args(hint) and (value is None or value is False):
            values[f.name] = None  # a table or a number left out: None in code, false in a file
        elif table is None:
            values[f.name] = _value(key, hint, value, f.metadata)
        elif lists_tables(hint):
            values[f.name] = _tables(table, value, folder, key, root)
        else:
            values[f.name] = table(**checked_values(table, value, folder, key + ".", root))
        if folder and f.metadata["picture"] and values[f.name]:
            values[f.name] = str((folder / values[f.name]).absolute())
            _require_text(key, values[f.name])
    return values


def _tables(
    kind: type[Record], data: object, folder: Path | None, key: str, root: type[Record]
) -> tuple[Record, ...]:
    """Return the records of a list of tables, whose names, where they have some, are unique."""
    if not isinstance(data, list | tuple) or len(data) > MOST_TABLES:
        raise UserError(
            f"{key} must be a list of tables, [[{key}]], at most {MOST_TABLES}, got {_brief(data)}"
        )
    records = []
    for k, table in enumerate(data):
        variant = _variant(kind, table, f"{key}[{k}]")
        records.append(variant(**checked_values(variant, table, folder, f"{key}[{k}].", root)))
    names = [getattr(record, "name", "") for record in records]
    for k, name in enumerate(names):
        if name and not NAME.fullmatch(name):
            raise UserError(
                f"{key}[{k}].name must begin with a letter and hold letters, digits, _ and - only, "
                f"got {_brief(name)}"
            )
        if name and name in names[:k]:
            raise UserError(f"{key}[{k}].name must differ from that of {key}[{names.index(name)}], {name!r}")
    return tuple(records)


def _variant(kind: type[Record], table: object, key: str) -> type[Record]:
    """Return the record of a table of several kinds, which its key `kind` names, or of one kind."""
    kinds: Mapping[object, type[Record]] = getattr(kind, "kinds", {})
    if not kinds:
        return kind
    if isinstance(table, kind):
        return type(table)
    name = table.get("kind") if isinstance(table, Mapping) else None
    if name not in kinds:
        raise UserError(f"{key}.kind must be one of {', '.join(map(repr, kinds))}, got {_brief(name)}")
    return kinds[name]


def _value(key: str, hint: Any, value: Any, limits: Mapping[str, Any]) -> Any:
    if isinstance(hint, UnionType) and not limits["auto"]:  # a name, or rows of numbers; what may be left out
        kinds = [kind for kind in get_args(hint) if kind is not NoneType]
        hint = next((kind for kind in kinds if (kind is str) == isinstance(value, str)), kinds[0])
    if get_origin(hint) is tuple:
        return _row(key, hint, value, limits)
    if hint is str:
        if limits["picture"] and isinstance(value, os.PathLike):
            value = os.fspath(value)
        if not isinstance(value, str):
            raise UserError(f"{key} must be a string, got {_brief(value)}")
        if limits["picture"] and "\0" in value:
            raise UserError(f"{key} must not hold a zero character")
        _require_text(key, value)
        if limits["choices"] and value not in limits["choices"]:
            reason = cannot_do(value)
            raise UserError(
                f"{key} must be one of {', '.join(map(repr, limits['choices']))}, got {_brief(value)}"
                + f"; {reason}" * bool(reason)
            )
        return str(value)
    if hint is bool:
        if not isinstance(value, bool):
            raise UserError(f"{key} must be true or false, got {_brief(value)}")
        return value
    if limits["auto"]:
        if isinstance(value, str) and value == AUTO:
            return AUTO
        hint = get_args(hint)[0]
    wanted = "a whole number" if hint is int else "a number"
    if limits["auto"]:
        wanted += f' or "{AUTO}"'
    if isinstance(value, bool) or not isinstance(value, Integral if hint is int else Real):
        raise UserError(f"{key} must be {wanted}, got {_brief(value)}")
    if isinstance(value, Integral) and abs(int(value)) > LARGEST:
        raise UserError(f"{key} must not be larger than {LARGEST:g} in size")
    value = int(value) if isinstance(value, Integral) else float(value)
    _require_range(key, value, limits)
    return hint(value)


def _require_text(key: str, value: str) -> None:
    if not is_text(value):
        raise UserError(f"{key} must be text that UTF-8 can hold, got {_brief(value)}; rename what it names")


def _require_range(key: str, value: float, limits: Mapping[str, Any]) -> None:
    if limits["infinite"] and math.isinf(value) and (value > 0 or limits["size"] or limits["zero"]):
        return
    if value == 0 and limits["zero"]:
        return
    if not math.isfinite(value):
        kind = "a number or inf" if limits["infinite"] else "a finite number"
        raise UserError(f"{key} must be {kind}, got {value!r}")
    for name, word, broken in (
        ("low", "at least", lambda v, b: v < b),
        ("high", "at most", lambda v, b: v > b),
        ("above", "greater than", lambda v, b: v <= b),
    ):
        if limits[name] is not None and broken(value, limits[name]):
            raise UserError(f"{key} must be {word} {limits[name]:.7g}, got {value!r}")
    if limits["infinite"] and value == 0:  # of a surface: a target has its own limit
        raise UserError(f"{key} must not be 0; inf is a plane")
    if limits["size"] and not limits["size"][0] <= abs(value) <= limits["size"][1]:
        low, high = limits["size"]
        wanted = f"at least {low:g} and at most {high:g}" if low else f"at most {high:g}"
        raise UserError(f"{key} must be {wanted} in size, got {value!r}")


def _row(key: str, hint: Any, value: object, limits: Mapping[str, Any]) -> tuple[Any, ...]:
    kinds = get_args(hint)
    open_ended = kinds[-1] is Ellipsis
    if get_origin(kinds[0]) is tuple:
        if not isinstance(value, (list, tuple)) or len(value) > MOST_ROWS:
            size = f", at most {MOST_ROWS}" if isinstance(value, (list, tuple)) else ""
            rows = f"a list of rows of {len(get_args(kinds[0]))} numbers{size}"
            raise UserError(f"{key} must be {rows}, got {_brief(value)}")
        return tuple(_row(f"{key}[{k}]", kinds[0], row, limits) for k, row in enumerate(value))
    if open_ended and not isinstance(value, (list, tuple)):
        value = [value]
    if not isinstance(value, (list, tuple)) or not value or (not open_ended and len(value) != len(kinds)):
        wanted = (
            f"a list of {'names' if kinds[0] is str else 'numbers'}, at least one"
            if open_ended
            else f"a list of {len(kinds)} numbers"
        )
        raise UserError(f"{key} must be {wanted}, got {_brief(value)}")
    return tuple(_value(f"{key}[{k}]", kinds[0], v, limits) for k, v in enumerate(value))


def _brief(value: object) -> str:
    """Return a short text of any value, for messages."""
    return reprlib.repr(value) if not isinstance(value, int) or abs(value) <= LARGEST else "a huge number"
