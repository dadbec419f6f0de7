"""The native files of surfaces and curves: THB, B-spline and NURBS as JSON that keeps every bit."""

from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

from thbcad.checks import Floats, require_type, shown
from thbcad.hierarchy import THBSpace
from thbcad.io.json_values import a_list, a_row, cells, read_json, require_keys, require_schema, write_json
from thbcad.splines import BSplineCurve, BSplineSurface, KnotVector, NURBSCurve, NURBSSurface
from thbcad.surfaces import THBSurface

SCHEMA = "thbcad-surface"
CURVE_SCHEMA = "thbcad-curve"
VERSION = 1
SAG_KEYS = ("degree", "knots", "refined", "coefficients")
HEAD_KEYS = ("schema", "version", "kind", "shape")
KEYS = {
    "thb": (*HEAD_KEYS, *SAG_KEYS),
    "bspline": (*HEAD_KEYS, "degree", "knots", "coefficients"),
    "nurbs": (*HEAD_KEYS, "degree", "knots", "coefficients", "weights"),
}
CURVE_KEYS = {kind: KEYS[kind] for kind in ("bspline", "nurbs")}
MOST_CELLS = 1_000_000  # on level 0, so that a small file cannot ask for all memory

Surface = THBSurface | BSplineSurface | NURBSSurface
Curve = BSplineCurve | NURBSCurve


def write_surface(surface: Surface, path: str | Path) -> None:
    """Write a surface to a native JSON file, atomically."""
    require_type("surface", surface, THBSurface, BSplineSurface, NURBSSurface)
    write_json(surface_to_dict(surface), path)


def read_surface(path: str | Path) -> Surface:
    """Read a native JSON file.

    Raises OSError : unreadable; ValueError : not such a file.
    """
    return surface_from_dict(read_json(path, "surface"))


def write_curve(curve: Curve, path: str | Path) -> None:
    """Write a curve to a native JSON file, atomically."""
    require_type("curve", curve, BSplineCurve, NURBSCurve)
    write_json(curve_to_dict(curve), path)


def read_curve(path: str | Path) -> Curve:
    """Read a native JSON file of a curve.

    Raises OSError : unreadable; ValueError : not such a file.
    """
    return curve_from_dict(read_json(path, "curve"))


def surface_to_dict(surface: Surface) -> dict[str, Any]:
    """Return a surface as plain lists, numbers and strings; nets are flat, with their shape beside them."""
    head = {"schema": SCHEMA, "version": VERSION}
    if isinstance(surface, THBSurface):
        shape = list(surface.coefficients.shape)
        return head | {"kind": "thb", "shape": shape} | sag_to_dict(surface)
    net = surface.coefficients
    extra: dict[str, Any] = {"kind": "bspline"}
    if isinstance(surface, NURBSSurface):
        extra = {"kind": "nurbs", "weights": surface.weights.ravel().tolist()}
    return (
        head
        | extra
        | _knots_to_dict(surface.kv_u, surface.kv_v)
        | {"shape": list(net.shape), "coefficients": net.ravel().tolist()}
    )


def surface_from_dict(data: object) -> Surface:
    """Return the surface of `surface_to_dict`."""
    table = require_schema(data, SCHEMA, VERSION, "surface")
    try:
        kind = _kind(table, KEYS, "surface")
        require_keys(table, KEYS[kind], "surface")
        net = _shaped(table, "coefficients", a_list(table, "shape"))
        if kind == "thb":
            return THBSurface(_space_from_dict(table), net)
        if kind == "bspline":
            return BSplineSurface(*_knots_from_dict(table), net)
        weights = _shaped(table, "weights", a_list(table, "shape")[:2])
        return NURBSSurface(*_knots_from_dict(table), net, weights)
    except KeyError as error:
        raise ValueError(f"the surface file lacks the key {error}") from None


def curve_to_dict(curve: Curve) -> dict[str, Any]:
    """Return a curve as plain lists, numbers and strings, as `surface_to_dict`."""
    weights = {"weights": curve.weights.tolist()} if isinstance(curve, NURBSCurve) else {}
    return {
        "schema": CURVE_SCHEMA,
        "version": VERSION,
        "kind": "nurbs" if weights else "bspline",
        "degree": curve.kv.degree,
        "knots": curve.kv.knots.tolist(),
        "shape": list(curve.coefficients.shape),
        "coefficients": curve.coefficients.ravel().tolist(),
    } | weights


def curve_from_dict(data: object) -> Curve:
    """Return the curve of `curve_to_dict`; raise as `surface_from_dict`."""
    table = require_schema(data, CURVE_SCHEMA, VERSION, "curve")
    try:
        kind = _kind(table, CURVE_KEYS, "curve")
        require_keys(table, CURVE_KEYS[kind], "curve")
        kv = KnotVector(table["degree"], a_row(table["knots"], "knots"))
        net = _shaped(table, "coefficients", a_list(table, "shape"))
        if kind == "bspline":
            return BSplineCurve(kv, net)
        return NURBSCurve(kv, net, a_row(table["weights"], "weights"))
    except KeyError as error:
        raise ValueError(f"the curve file lacks the key {error}") from None


def _kind(table: dict[str, Any], known: Mapping[str, object], content: str) -> str:
    """Return the kind of spline in a file; raise ValueError for one that is not known."""
    kind = table["kind"]
    if not isinstance(kind, str) or kind not in known:
        *others, last = (repr(name) for name in known)
        wanted = f"{', '.join(others)} or {last}" if others else last
        raise ValueError(f"the {content} file's kind must be {wanted}, got {shown(kind)}")
    return kind


def sag_to_dict(sag: THBSurface) -> dict[str, Any]:
    """Return a THB surface as plain data."""
    space = sag.space
    refined = [cells.tolist() for cells in space.refined]
    return _knots_to_dict(space.kv_u, space.kv_v) | {
        "refined": refined,
        "coefficients": sag.coefficients.ravel().tolist(),
    }


def sag_from_dict(data: dict[str, Any]) -> THBSurface:
    """Return the THB surface of `sag_to_dict`, which has scalar coefficients.

    Raises ValueError : an unknown key, values of the wrong type or number, more cells than MOST_CELLS.
    """
    require_keys(data, SAG_KEYS, "surface")
    return THBSurface(_space_from_dict(data), a_row(data["coefficients"], "coefficients"))


def _knots_to_dict(kv_u: KnotVector, kv_v: KnotVector) -> dict[str, Any]:
    return {"degree": [kv_u.degree, kv_v.degree], "knots": [kv_u.knots.tolist(), kv_v.knots.tolist()]}


def _knots_from_dict(data: dict[str, Any]) -> tuple[KnotVector, KnotVector]:
    degrees = a_list(data, "degree")
    knots = a_list(data, "knots")
    if len(degrees) != 2 or len(knots) != 2:
        raise ValueError(
            f"a surface has 2 degrees and 2 knot vectors, the file has {len(degrees)} and {len(knots)}"
        )
    kv_u, kv_v = (KnotVector(p, a_row(t, "knots")) for p, t in zip(degrees, knots))
    return kv_u, kv_v


def _space_from_dict(data: dict[str, Any]) -> THBSpace:
    kv_u, kv_v = _knots_from_dict(data)
    if kv_u.spans * kv_v.spans > MOST_CELLS:
        raise ValueError(
            f"the surface has {kv_u.spans} x {kv_v.spans} cells on level 0, more than {MOST_CELLS}"
        )
    space = THBSpace(kv_u, kv_v)
    for level, rows in enumerate(a_list(data, "refined")):
        space = space.refine({level: cells(rows, "refined")})
    return space


def _shaped(data: dict[str, Any], key: str, shape: list[Any]) -> Floats:
    """Return the numbers under a key in a shape that the file gives."""
    row = a_row(data[key], key)
    if not all(type(n) is int and n > 0 for n in shape) or prod(shape) != len(row):
        raise ValueError(f"the file's {key} are {len(row)} numbers, which is not the shape {shape}")
    return row.reshape(shape)
