"""Values of STEP entities, checked as they are read: references, lists, reals, points, curves, surfaces."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from thbcad.checks import MAX_DEGREE, Floats
from thbcad.io.brep_records import BrepCurve, Extrusion
from thbcad.io.step_text import REAL, STRING, Entities, Entity, Reference, Typed, Value
from thbcad.sags import ConicCurve
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface

HEAD = rf"CARTESIAN_POINT\s*+\(\s*+{STRING}\s*+,"
BEFORE = re.compile(HEAD, re.ASCII)
ROWS = {  # of points, each with ";" behind it
    dimensions: re.compile(
        rf"(?>(?:{HEAD}\s*+\(\s*+" + r"\s*+,\s*+".join([REAL] * dimensions) + r"\s*+\)\s*+\)\s*+;)*)",
        re.ASCII,
    )
    for dimensions in (2, 3)
}
ONLY_REALS = str.maketrans(";", ",", "() \t\n\r\f\v")
CONICS = {"CIRCLE": 1, "ELLIPSE": 2, "HYPERBOLA": 2, "PARABOLA": 1}  # and how many sizes each has
ANGLES = {  # which parameters are angles
    "SPHERICAL_SURFACE": (True, True),
    "CYLINDRICAL_SURFACE": (True, False),
    "CONICAL_SURFACE": (True, False),
}
FARTHEST = 1e9  # of coordinates in the file's unit: programs work for hours on shapes without end
LARGEST = 1e15  # of radii, great where a curve is nearly flat: float64 has steps of a tenth there
UPWARD = (0.0, 0.0, 1.0)  # the axis of a placement that names none
OTHERS_DEGREE = 25  # the greatest of OCCT
UNIT_LENGTH = 1e-15  # within which a direction has the length 1: some rounding errors
WORDS = {2: "two", 3: "three"}


def direction_of(entities: Entities, value: Value, user: Entity, dimensions: int = 3) -> Floats:
    """Return a DIRECTION with two or three components, of which only the ratios count, with the length 1.

    One that has it but for rounding comes bit for bit.
    """
    direction = entity_of(entities, value, user)
    row = reals_of(direction.parameters("DIRECTION", 2)[1], direction)
    if len(row) != dimensions or not np.isfinite(row).all() or not any(row):
        raise direction.wrong(f" must have {WORDS[dimensions]} finite components, not all zero")
    if abs(math.hypot(*row) - 1) <= UNIT_LENGTH:
        return np.array(row)
    scaled = np.array(row) / max(map(abs, row))  # else squares leave the range of float64
    return scaled / np.linalg.norm(scaled)


def spline_row(entity: Entity, what: str, count: int) -> list[Value]:
    """Return the parameters of a spline as those of the simple form, also where a complex one splits them."""
    base = f"B_SPLINE_{what}"
    with_knots = f"B_SPLINE_{what}_WITH_KNOTS"
    row = entity.parts[with_knots]
    if base in entity.parts:
        row = [None, *entity.parts[base], *row]
    if len(row) != count:
        raise entity.wrong(f": {with_knots} must have {count} parameters, got {len(row)}")
    return row


def knots_of(entity: Entity, degree: Value, times: Value, values: Value) -> KnotVector:
    """Return the knot vector of distinct knots and how often each occurs."""
    counts = list_of(times, entity)
    knots = reals_of(values, entity)
    # no knot occurs more often than degree + 1 times, so that repeating them takes little memory
    whole = [n for n in [degree, *counts] if type(n) is int and 1 <= n <= 11]
    if len(whole) != 1 + len(counts) or len(counts) != len(knots):
        raise entity.wrong(" must have as many multiplicities, from 1 to 11, as knots")
    try:
        kv = KnotVector(whole[0], np.repeat(knots, whole[1:]))
    except ValueError as error:
        raise entity.wrong(f": {error}") from None
    if not kv.is_clamped:
        raise entity.wrong(f": the first and the last {kv.degree + 1} knots must be equal (clamped)")
    return kv


def net_of(value: Value, knots: Sequence[KnotVector], entity: Entity) -> list[list[Value]]:
    """Return rows of poles or weights, as many as the knots want."""
    rows = [list_of(line, entity) for line in list_of(value, entity)]
    wanted = (knots[0].dim, knots[1].dim)
    widths = {len(line) for line in rows}
    if len(rows) != wanted[0] or widths != {wanted[1]}:
        got = f"{len(rows)} x {' or '.join(map(str, sorted(widths)[:3]))}"
        raise entity.wrong(f" must have {wanted[0]} x {wanted[1]} poles by its knots, got {got}")
    return rows


def points_of(entities: Entities, references: Sequence[Value], user: Entity, dimensions: int = 3) -> Floats:
    """Return the coordinates of CARTESIAN_POINTs, (n, dimensions), none beyond 1e9."""
    texts = [entities.texts.get(k) if isinstance(k, Reference) else None for k in references]
    row = "".join([f"{text};" for text in texts])
    if not ROWS[dimensions].fullmatch(row):
        for point in [entity_of(entities, k, user) for k in references]:
            if not ROWS[dimensions].fullmatch(f"{point.text};"):
                what = f"a CARTESIAN_POINT of {WORDS[dimensions]} reals"
                raise point.wrong(f" must be {what}, got {point.text[:60]!r}")
    reals = BEFORE.sub("", row).translate(ONLY_REALS)[:-1]
    rows = np.fromstring(reals, sep=",").reshape(-1, dimensions)
    near = (np.abs(rows) <= FARTHEST).all(axis=1)
    if not near.all():
        point = entity_of(entities, references[int(np.argmin(near))], user)
        raise point.wrong(f" has a coordinate beyond {FARTHEST:g}, farther than a part reaches")
    return rows


def entity_of(entities: Entities, value: Value, user: Entity) -> Entity:
    if not isinstance(value, Reference) or value not in entities:
        raise user.wrong(f" must refer to an entity of the file, got {str(value)[:40]}")
    return entities[value]


def list_of(value: Value, user: Entity) -> list[Value]:
    if not isinstance(value, list):
        raise user.wrong(f" must have a list, got {str(value)[:40]}")
    return value


def entities_of(entities: Entities, value: Value, user: Entity) -> list[Entity]:
    """Return the entities to which a list refers."""
    return [entity_of(entities, reference, user) for reference in list_of(value, user)]


def reals_of(value: Value, user: Entity) -> list[float]:
    values = list_of(value, user)
    reals = [v for v in values if type(v) is float]
    if len(reals) != len(values):
        raise user.wrong(" must have a list of reals")
    return reals


def flag_of(value: Value, user: Entity) -> bool:
    if value not in ("T", "F"):
        raise user.wrong(f" must have .T. or .F., got {str(value)[:40]}")
    return value == "T"


def text_of(value: Value, user: Entity) -> str:
    if not isinstance(value, str):
        raise user.wrong(f" must have a name, got {str(value)[:40]}")
    return value


def spline_surface(entities: Entities, surface: Entity) -> BSplineSurface | NURBSSurface | None:
    """Return a spline surface, None for another one and for a degree above 10, as roundings of edges have."""
    if "B_SPLINE_SURFACE_WITH_KNOTS" not in surface.parts:
        return None
    row = spline_row(surface, "SURFACE", 13)
    if any(map(_high, row[1:3])):
        return None
    knots = knots_of(surface, row[1], row[8], row[10]), knots_of(surface, row[2], row[9], row[11])
    net = net_of(row[3], knots, surface)
    flat = points_of(entities, [k for line in net for k in line], surface)
    poles = flat.reshape(knots[0].dim, knots[1].dim, 3)
    if "RATIONAL_B_SPLINE_SURFACE" not in surface.parts:
        return BSplineSurface(*knots, poles)
    weights = net_of(surface.parameters("RATIONAL_B_SPLINE_SURFACE", 1)[0], knots, surface)
    return NURBSSurface(*knots, poles, np.array([reals_of(line, surface) for line in weights]))


def placed(entities: Entities, surface: Entity, kind: str, sizes: int = 0) -> Floats | None:
    """Return the placement of a surface of a kind and, where it has sizes, a row of them; None for another
    kind."""
    if kind not in surface.parts:
        return None
    _, where, *values = surface.parameters(kind, 2 + sizes)
    rows = _placement(entities, where, surface, 3)
    return rows if not sizes else np.vstack([rows, [*_sizes(values, surface), *[0.0] * (3 - sizes)]])


def cone(entities: Entities, surface: Entity, radians: float) -> Floats | None:
    """Return a cone as `placed`, its half angle in radians; None for another surface."""
    rows = placed(entities, surface, "CONICAL_SURFACE", 2)
    if rows is not None:
        rows[3, 1] *= radians
    return rows


def extrusion(entities: Entities, surface: Entity) -> Extrusion | None:
    """Return an extrusion of a curve that is known, None for another surface."""
    if "SURFACE_OF_LINEAR_EXTRUSION" not in surface.parts:
        return None
    _, swept, along = surface.parameters("SURFACE_OF_LINEAR_EXTRUSION", 3)
    curve = curve_of(entities, entity_of(entities, swept, surface))
    return Extrusion(curve, _vector(entities, along, surface, 3)) if curve.known else None


def curve_of(entities: Entities, curve: Entity, dimensions: int = 3) -> BrepCurve:
    """Return a curve in space or, with two dimensions, in the parameters of a surface."""
    if "LINE" in curve.parts:
        _, start, along = curve.parameters("LINE", 3)
        step = _vector(entities, along, curve, dimensions)
        point = points_of(entities, [start], curve, dimensions)[0]
        return BrepCurve(poles=np.stack([point, point + step]))
    if "B_SPLINE_CURVE_WITH_KNOTS" in curve.parts:
        row = spline_row(curve, "CURVE", 9)
        return BrepCurve() if _high(row[1]) or _periodic(row) else _spline(entities, curve, dimensions)
    for kind, count in CONICS.items():
        if kind in curve.parts:
            _, where, *values = curve.parameters(kind, 2 + count)
            sizes = _sizes(values, curve)
            return BrepCurve(
                conic=ConicCurve(kind, _placement(entities, where, curve, dimensions), np.resize(sizes, 2))
            )
    return BrepCurve()


def in_radians(curve: BrepCurve, surface: Entity, radians: float) -> BrepCurve:
    """Return the image of an edge in the parameters of a surface with its angles in radians."""
    angles = [pair for kind, pair in ANGLES.items() if kind in surface.parts]
    if radians == 1 or not angles:
        return curve
    if curve.poles is None:
        return BrepCurve()  # a stretched circle is none
    return replace(curve, poles=curve.poles * np.where(angles[0], radians, 1.0))


def radians_of(entities: Entities, units: Sequence[Entity]) -> float:
    """Return how many radians the unit of plane angles has, 1 for none; raise ValueError where it is open."""
    for unit in units:
        if "CONVERSION_BASED_UNIT" in unit.parts:
            measured = entity_of(entities, unit.parameters("CONVERSION_BASED_UNIT", 2)[1], unit)
            for kind in measured.parts:
                if kind.endswith("MEASURE_WITH_UNIT") and len(measured.parts[kind]) == 2:
                    value = measured.parts[kind][0]
                    (size,) = reals_of(value.parameters if isinstance(value, Typed) else [value], measured)
                    if 0 < size < np.inf:
                        return size
        elif unit.parameters("SI_UNIT", 2) == [None, "RADIAN"]:
            continue
        raise ValueError(f"the unit of plane angles #{unit.number} must be radians or a number of them")
    return 1.0


def _high(degree: Value) -> bool:
    """Return whether a degree is above that of the splines here, but one that CAD kernels have."""
    return type(degree) is int and MAX_DEGREE < degree <= OTHERS_DEGREE


def _periodic(row: Sequence[Value]) -> bool:
    """Return whether a closed spline has the knots of a period, whose ends are not clamped.

    OCCT writes circles so in the parameters of a plane whose axes turn the other way round.
    """
    counts = row[6] if isinstance(row[6], list) else []
    return (
        row[4] == "T" and counts[:1] != [] and isinstance(row[1], int) and counts[0] in range(1, row[1] + 1)
    )


def _spline(entities: Entities, curve: Entity, dimensions: int) -> BrepCurve:
    row = spline_row(curve, "CURVE", 9)
    kv = knots_of(curve, row[1], row[6], row[7])
    poles = list_of(row[2], curve)
    _require_as_many(curve, "poles", poles, kv)
    points = points_of(entities, poles, curve, dimensions)
    if "RATIONAL_B_SPLINE_CURVE" not in curve.parts:
        return BrepCurve(kv=kv, poles=points)
    weights = reals_of(curve.parameters("RATIONAL_B_SPLINE_CURVE", 1)[0], curve)
    _require_as_many(curve, "weights", weights, kv)
    return BrepCurve(kv=kv, poles=points, weights=np.array(weights))


def _require_as_many(curve: Entity, what: str, values: list[Value] | list[float], kv: KnotVector) -> None:
    if len(values) != kv.dim:
        raise curve.wrong(f" must have {kv.dim} {what} by its knots, got {len(values)}")


def _vector(entities: Entities, value: Value, user: Entity, dimensions: int) -> Floats:
    vector = entity_of(entities, value, user)
    _, direction, magnitude = vector.parameters("VECTOR", 3)
    (length,) = reals_of([magnitude], vector)
    if not abs(length) <= FARTHEST:
        raise vector.wrong(f" must have a magnitude of at most {FARTHEST:g}, got {length:g}")
    return direction_of(entities, direction, vector, dimensions) * length


def _placement(entities: Entities, value: Value, user: Entity, dimensions: int) -> Floats:
    """Return rows centre, axis and first direction, (3, 3); what is left out is as ISO 10303-42 wants it."""
    placement = entity_of(entities, value, user)
    if dimensions == 2:
        _, point, first = placement.parameters("AXIS2_PLACEMENT_2D", 3)
        rows = np.array([[0.0, 0.0, 0.0], UPWARD, [1.0, 0.0, 0.0]])
        rows[0, :2] = points_of(entities, [point], placement, 2)[0]
        if first is not None:
            rows[2, :2] = direction_of(entities, first, placement, 2)
        return rows
    _, point, axis, first = placement.parameters("AXIS2_PLACEMENT_3D", 4)
    normal = np.array(UPWARD) if axis is None else direction_of(entities, axis, placement)
    if first is None:
        along = np.eye(3)[int(not normal[1:].any())]
    else:
        along = direction_of(entities, first, placement)
    if not np.cross(normal, along).any():
        raise placement.wrong(" must have a first direction beside its axis")
    return np.stack([points_of(entities, [point], placement)[0], normal, along])


def _sizes(values: list[Value], user: Entity) -> list[float]:
    """Return the sizes of a curve or a surface; only the radius of a cone may be zero, at its apex."""
    sizes = reals_of(values, user)
    apex = "CONICAL_SURFACE" in user.parts and sizes[0] == 0
    if not (max(sizes) <= LARGEST and min(sizes[apex:]) > 0):
        raise user.wrong(f" must have positive sizes of at most {LARGEST:g}, got {sizes}")
    return sizes
