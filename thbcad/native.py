"""The native lens file: JSON that keeps every bit.

Python's JSON writes the shortest text that reads back to the same float64, so a round trip
changes nothing.  A plane has radius null.  Nothing in the file is executed.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from thbcad.atomic import write_text
from thbcad.bspline import KnotVector
from thbcad.lens import Conic, FreeformSurface, Lens
from thbcad.space import THBSpace
from thbcad.surface import THBSurface

SCHEMA = "thbcad-lens"
VERSION = 1


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
        front, rear = (_surface_from_dict(data[name]) for name in ("front", "rear"))
        return Lens(front, rear, float(data["thickness"]), float(data["index"]))
    except KeyError as error:
        raise ValueError(f"the lens file lacks the key {error}") from None
    except TypeError as error:
        raise ValueError(f"the lens file holds a value of the wrong type: {error}") from None


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


def _surface_to_dict(surface: FreeformSurface) -> dict[str, Any]:
    conic = surface.conic
    radius = None if conic.is_plane else conic.radius
    out: dict[str, Any] = {"half_width": list(surface.half_width), "radius": radius, "conic": conic.constant}
    if surface.sag is not None:
        out["sag"] = sag_to_dict(surface.sag)
    return out


def _surface_from_dict(data: dict[str, Any]) -> FreeformSurface:
    radius = np.inf if data["radius"] is None else float(data["radius"])
    sag = sag_from_dict(data["sag"]) if "sag" in data else None
    return FreeformSurface(tuple(data["half_width"]), Conic(radius, float(data["conic"])), sag)


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
    """Return the THB surface of `sag_to_dict`."""
    space = THBSpace(*(KnotVector(p, t) for p, t in zip(data["degree"], data["knots"])))
    for level, cells in enumerate(data["refined"]):
        space = space.refine({level: cells})
    return THBSurface(space, data["coefficients"])
