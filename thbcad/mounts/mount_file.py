"""Mounts as TOML files: every key is known, or a sentence names it."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from thbcad.checks import shown
from thbcad.files import file_or_pipe_bytes
from thbcad.mounts.records import Gate, Hole, Mount, MountFlange, Places, Post
from thbcad.texts import text_of
from thbcad.toml import toml_tables

MOST_BYTES = 1 << 20  # a mount has some kB


def read_mount(path: str | Path) -> Mount:
    """Read a mount.toml.

    path : of a file, or of a pipe.

    Raises OSError : the file cannot be read.
    Raises ValueError : it is no TOML; as `mount_of`.  Messages name the path.
    """
    data = file_or_pipe_bytes(path, MOST_BYTES)
    try:
        return mount_of(toml_tables(text_of(data)))
    except ValueError as error:  # that of TOML too
        raise ValueError(f"{path}: {error}") from None


def mount_of(data: Mapping[str, Any]) -> Mount:
    """Return the Mount of tables: [flange], [[holes]], [[pins]], [[bosses]], [gate], wall and clearance.

    Raises ValueError : an unknown or missing key; a value of another type or beyond its limits.
    """
    plain = [f.name for f in fields(Mount) if f.metadata]
    _require_known("the file", data, ("flange", "holes", "pins", "bosses", "gate", *plain))
    if "flange" not in data:
        raise ValueError("the table [flange] is missing; a mount begins with its flange")
    posts = [
        Post(word, **_placed(f"{table}[{k + 1}]", row, Post))
        for word, table in (("pin", "pins"), ("boss", "bosses"))
        for k, row in enumerate(_tables(data, table))
    ]
    holes = [Hole(**_placed(f"holes[{k + 1}]", row, Hole)) for k, row in enumerate(_tables(data, "holes"))]
    gate = Gate(**_table("gate", data["gate"], Gate)) if "gate" in data else None
    flange = MountFlange(**_table("flange", data["flange"], MountFlange))
    return Mount(flange, tuple(holes), tuple(posts), gate, **{key: data[key] for key in plain if key in data})


def _tables(data: Mapping[str, Any], name: str) -> list[Any]:
    rows = data.get(name, [])
    if not isinstance(rows, list):
        raise ValueError(f"{name} must be tables [[{name}]], got {type(rows).__name__}")
    return rows


def _placed(where: str, row: Any, kind: type[Hole | Post]) -> dict[str, Any]:
    """Return the fields of holes or posts, their positions among them."""
    own = [f.name for f in fields(Places)]
    values = _table(where, row, kind, own)
    places = Places(**{key: values.pop(key) for key in own if key in values})
    if not isinstance(places.at, list | tuple):
        raise ValueError(f"{where}.at must be pairs [x, y], got {shown(places.at)}")
    places.points(where)
    return values | {"places": places}


def _table(where: str, row: Any, kind: type, more: Sequence[str] = ()) -> dict[str, Any]:
    if not isinstance(row, Mapping):
        raise ValueError(f"{where} must be a table, got {type(row).__name__}")
    own = [f for f in fields(kind) if f.name not in ("places", "word")]
    _require_known(where, row, (*(f.name for f in own), *more))
    for f in own:  # a number above 0 whose default is 0 has none
        if "above" in f.metadata and f.default == 0 and f.name not in row:
            raise ValueError(f"the key {where}.{f.name} is missing; add it in mm")
    return dict(row)


def _require_known(where: str, row: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for key in row:
        if key not in known:
            near = get_close_matches(key, known, 1)
            meant = f" (did you mean {near[0]}?)" if near else ""
            raise ValueError(f"unknown key {key}{meant}; {where} takes {', '.join(known)}")
