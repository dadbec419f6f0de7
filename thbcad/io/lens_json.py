"""The native lens file: JSON that keeps every bit.

Python's JSON writes the shortest text that reads back to the same float64, so a round trip
changes nothing.  A plane has radius null.  Nothing in the file is executed.
"""

from pathlib import Path
from typing import Any

import numpy as np

from thbcad.checks import shown
from thbcad.io.json_values import (
    a_number,
    a_row,
    a_table,
    read_json,
    require_keys,
    require_schema,
    write_json,
)
from thbcad.io.spline_json import sag_from_dict, sag_to_dict
from thbcad.lens import FreeformSurface, Lens, require_sound
from thbcad.sags import Conic

SCHEMA = "thbcad-lens"
VERSION = 1
KEYS = ("schema", "version", "units", "index", "thickness", "front", "rear")
SURFACE_KEYS = ("half_width", "radius", "conic", "corners", "sag")


def lens_to_dict(lens: Lens) -> dict[str, Any]:
    """Return the lens as plain lists, numbers and strings."""
    return {
        "schema": SCHEMA,
        "version": VERSION,
        "units": "mm",
        "index": lens.index,
        "thickness": lens.thickness,
        "front": _surface_to_dict(lens.front),
        "rear": _surface_to_dict(lens.rear),
    }


def lens_from_dict(data: object) -> Lens:
    """Return the lens of `lens_to_dict`.

    Raises ValueError : another schema, version or units, a missing or unknown key, or numbers that make no
        lens.
    """
    table = require_schema(data, SCHEMA, VERSION, "lens")
    require_keys(table, KEYS, "lens")
    if table.get("units") != "mm":
        raise ValueError(f"the lens file's units must be 'mm', got {shown(table.get('units'))}")
    try:
        front, rear = (_surface_from_dict(a_table(table, name)) for name in ("front", "rear"))
        return require_sound(Lens(front, rear, a_number(table, "thickness"), a_number(table, "index")))
    except KeyError as error:
        raise ValueError(f"the lens file lacks the key {error}") from None


def write_lens(lens: Lens, path: str | Path) -> None:
    """Write the lens to a native JSON file, atomically.

    Raises OSError : the file cannot be written.  ValueError : as `require_sound`.
    """
    write_json(lens_to_dict(require_sound(lens)), path)


def read_lens(path: str | Path) -> Lens:
    """Read a native JSON file.

    Raises OSError : unreadable; ValueError : not such a file.
    """
    return lens_from_dict(read_json(path, "lens"))


def _surface_to_dict(surface: FreeformSurface) -> dict[str, Any]:
    conic = surface.conic
    radius = None if conic.is_plane else conic.radius
    out: dict[str, Any] = {"half_width": list(surface.half_width), "radius": radius, "conic": conic.constant}
    if not surface.outline.is_rectangle:
        out["corners"] = list(surface.corners)
    if surface.sag is not None:
        out["sag"] = sag_to_dict(surface.sag)
    return out


def _surface_from_dict(data: dict[str, Any]) -> FreeformSurface:
    require_keys(data, SURFACE_KEYS, "lens")
    radius = np.inf if data["radius"] is None else a_number(data, "radius")
    sag = sag_from_dict(a_table(data, "sag")) if "sag" in data else None
    half_width = _pair(data["half_width"], "half_width")
    corners = _pair(data["corners"], "corners") if "corners" in data else (0.0, 0.0)
    return FreeformSurface(half_width, Conic(radius, a_number(data, "conic")), sag, corners)


def _pair(values: object, key: str) -> tuple[float, float]:
    """Return two numbers under a key."""
    row = a_row(values, key)
    if len(row) != 2:
        raise ValueError(f"the file's {key} must be 2 numbers, got {len(row)}")
    return row[0], row[1]
