"""The native lens file: JSON that keeps every bit.

Python's JSON writes the shortest text that reads back to the same float64, so a round trip
changes nothing.  A plane has radius null.  Nothing in the file is executed.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thbcad.bspline import KnotVector
from thbcad.conic import Conic
from thbcad.files import write_text
from thbcad.lens import FreeformSurface, Lens
from thbcad.space import THBSpace
from thbcad.surface import THBSurface

SCHEMA = "thbcad-lens"
VERSION = 1
MOST_CELLS = 10_000_000  # on level 0, so that a small file cannot ask for all memory


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

    Raises
    ------
    ValueError : another schema or version, a missing key, or numbers that make no lens.
    """
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise ValueError(f"not a lens file: its schema is not {SCHEMA!r}")
    if data.get("version") != VERSION:
        raise ValueError(f"lens file version {data.get('version')!r} is unknown, this program reads version {VERSION}")
    try:
        front, rear = (_surface_from_dict(_table(data, name)) for name in ("front", "rear"))
        return Lens(front, rear, _number(data, "thickness"), _number(data, "index"))
    except KeyError as error:
        raise ValueError(f"the lens file lacks the key {error}") from None


def write_lens(lens: Lens, path: str | Path) -> None:
    """Write the lens to a native JSON file, atomically."""
    write_text(path, json.dumps(lens_to_dict(lens), separators=(",", ":"), allow_nan=False))


def read_lens(path: str | Path) -> Lens:
    """Read a native JSON file.

    Raises
    ------
    OSError : unreadable; ValueError : not such a file.
    """
    try:
        return lens_from_dict(json.loads(Path(path).read_text("utf-8")))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not a lens file: {error}") from None
    except RecursionError:
        raise ValueError(f"{path} is not a lens file: it is nested too deeply") from None


def _surface_to_dict(surface: FreeformSurface) -> dict[str, Any]:
    conic = surface.conic
    radius = None if conic.is_plane else conic.radius
    out: dict[str, Any] = {"half_width": list(surface.half_width), "radius": radius, "conic": conic.constant}
    if surface.sag is not None:
        out["sag"] = sag_to_dict(surface.sag)
    return out


def _surface_from_dict(data: dict[str, Any]) -> FreeformSurface:
    radius = np.inf if data["radius"] is None else _number(data, "radius")
    sag = sag_from_dict(_table(data, "sag")) if "sag" in data else None
    half_width = _numbers(data, "half_width")
    if len(half_width) != 2:
        raise ValueError(f"the lens file's half_width must be 2 numbers, got {len(half_width)}")
    return FreeformSurface((half_width[0], half_width[1]), Conic(radius, _number(data, "conic")), sag)


def sag_to_dict(sag: THBSurface) -> dict[str, Any]:
    """Return a THB surface as plain data."""
    space = sag.space
    return {
        "degree": [space.kv_u.degree, space.kv_v.degree],
        "knots": [space.kv_u.knots.tolist(), space.kv_v.knots.tolist()],
        "refined": [cells.tolist() for cells in space.refined],
        "coefficients": sag.coefficients.tolist(),
    }


def sag_from_dict(data: dict[str, Any]) -> THBSurface:
    """Return the THB surface of `sag_to_dict`.

    Raises
    ------
    ValueError : values of the wrong type or number, more cells than MOST_CELLS.
    """
    degrees, knots, refined = (_list(data, name) for name in ("degree", "knots", "refined"))
    if len(degrees) != 2 or len(knots) != 2:
        raise ValueError(f"a sag has 2 degrees and 2 knot vectors, the file has {len(degrees)} and {len(knots)}")
    kv_u, kv_v = (KnotVector(p, _row(t, "knots")) for p, t in zip(degrees, knots))
    if kv_u.spans * kv_v.spans > MOST_CELLS:
        raise ValueError(f"the sag has {kv_u.spans} x {kv_v.spans} cells on level 0, more than {MOST_CELLS}")
    space = THBSpace(kv_u, kv_v)
    for level, cells in enumerate(refined):
        space = space.refine({level: cells})
    return THBSurface(space, _numbers(data, "coefficients"))


def _number(data: dict[str, Any], key: str) -> float:
    return float(_row([data[key]], key)[0])


def _numbers(data: dict[str, Any], key: str) -> NDArray[np.float64]:
    return _row(data[key], key)


def _row(values: object, key: str) -> NDArray[np.float64]:
    """Return a list of JSON numbers as floats; nothing else passes for a number."""
    if not isinstance(values, list) or not all(type(v) in (int, float) for v in values):
        raise ValueError(f"the lens file's {key} must hold numbers only")
    try:
        return np.array(values, dtype=np.float64)
    except OverflowError:
        raise ValueError(f"the lens file's {key} holds a number that float64 cannot hold") from None


def _list(data: dict[str, Any], key: str) -> list[Any]:
    if not isinstance(data[key], list):
        raise ValueError(f"the lens file's {key} must be a list")
    return data[key]


def _table(data: dict[str, Any], key: str) -> dict[str, Any]:
    if not isinstance(data[key], dict):
        raise ValueError(f"the lens file's {key} must be an object")
    return data[key]
