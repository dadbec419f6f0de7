"""The solid of a STEP file, from its text: faces and edges with their splines, length unit, name."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from thbcad.checks import Floats
from thbcad.io.brep_records import Brep, BrepEdge, BrepFace
from thbcad.io.step_text import REAL, STRING, Entity, Reference, Value, having, read_part21
from thbcad.splines import BSplineSurface, KnotVector, NURBSSurface

Entities = Mapping[int, Entity]
COORDINATES = r"\s*+,\s*+".join([f"({REAL})"] * 3)
POINT = re.compile(
    rf"CARTESIAN_POINT\s*+\(\s*+{STRING}\s*+,\s*+\(\s*+{COORDINATES}\s*+\)\s*+\)\s*+", re.ASCII
)
PLACED = ("MAPPED_ITEM", "ITEM_DEFINED_TRANSFORMATION", "CARTESIAN_TRANSFORMATION_OPERATOR_3D")
OTHER_SOLIDS = ("BREP_WITH_VOIDS", "FACETED_BREP", "SHELL_BASED_SURFACE_MODEL")


def parse_brep(path: str | Path) -> Brep:
    """Read the one solid of a STEP file from its text, without OCCT; numbers come bit for bit.

    Raises
    ------
    OSError : the file cannot be read.
    ValueError : as `read_part21`; not one solid, moved by a placement, or an entity of it that is not as ISO
        10303-42 wants it.
    """
    entities = read_part21(path)
    try:
        return brep(entities)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def brep(entities: Entities) -> Brep:
    """Return the one solid of a file's entities; raise ValueError as `parse_brep`."""
    names = [_text(e.parameters("PRODUCT", 4)[0], e) for e in having(entities, "PRODUCT")]
    placed = [e for kind in PLACED for e in having(entities, kind)]
    if placed:
        raise ValueError(f"the solid is moved by the placement #{placed[0].number}")
    shell = _shell(entities)
    loops = [loop for face in shell for loop in _loops(entities, face)]
    count = Counter(chain.from_iterable(loops))
    numbers = dict.fromkeys(number for number, _ in count)
    unpaired = sum(not count[number, True] == count[number, False] == 1 for number in numbers)
    return Brep(
        name=" ".join(names),
        unit=length_unit(entities),
        faces=tuple(_face(entities, face) for face in shell),
        edges=tuple(_edge(entities, entities[number]) for number in numbers),
        unpaired=unpaired,
        gaps=sum(_gaps(entities, loop) for loop in loops),
    )


def length_unit(entities: Entities) -> str:
    """Return the unit of length in which the solid is given: "MILLI METRE", "METRE", or the name of a
    converted unit.

    Raises
    ------
    ValueError : the solid stands in no representation, or that has not one unit of length.
    """
    solid = _solid(entities).number
    for shape in having(entities, "ADVANCED_BREP_SHAPE_REPRESENTATION"):
        _, items, context = shape.parameters("ADVANCED_BREP_SHAPE_REPRESENTATION", 3)
        if solid in _list(items, shape):
            (units,) = _entity(entities, context, shape).parameters("GLOBAL_UNIT_ASSIGNED_CONTEXT", 1)
            lengths = [
                u
                for u in (_entity(entities, k, shape) for k in _list(units, shape))
                if "LENGTH_UNIT" in u.parts
            ]
            if len(lengths) != 1:
                raise ValueError(
                    f"the representation #{shape.number} must have one unit of length, got {len(lengths)}"
                )
            if "CONVERSION_BASED_UNIT" in lengths[0].parts:
                return _text(lengths[0].parameters("CONVERSION_BASED_UNIT", 2)[0], lengths[0])
            return " ".join(
                _text(part, lengths[0]) for part in lengths[0].parameters("SI_UNIT", 2) if part is not None
            )
    raise ValueError(f"the solid #{solid} stands in no ADVANCED_BREP_SHAPE_REPRESENTATION")


def _solid(entities: Entities) -> Entity:
    solids = having(entities, "MANIFOLD_SOLID_BREP")
    others = [k for k in OTHER_SOLIDS if having(entities, k)]
    if len(solids) != 1 or others:
        raise ValueError(
            "the file must hold one MANIFOLD_SOLID_BREP, got "
            f"{len(solids)}{''.join(f' and a {k}' for k in others)}"
        )
    return solids[0]


def _shell(entities: Entities) -> list[Entity]:
    """Return the ADVANCED_FACEs of the solid's outer shell."""
    solid = _solid(entities)
    shell = _entity(entities, solid.parameters("MANIFOLD_SOLID_BREP", 2)[1], solid)
    faces = [_entity(entities, k, shell) for k in _list(shell.parameters("CLOSED_SHELL", 2)[1], shell)]
    if len({face.number for face in faces}) != len(faces):
        raise ValueError(f"the shell #{shell.number} names a face twice")
    return faces


def _loops(entities: Entities, face: Entity) -> list[list[tuple[int, bool]]]:
    """Return the loops around a face: edges, each with whether it is passed forwards."""
    loops = []
    for bound in (_entity(entities, k, face) for k in _list(face.parameters("ADVANCED_FACE", 4)[1], face)):
        kind = "FACE_OUTER_BOUND" if "FACE_OUTER_BOUND" in bound.parts else "FACE_BOUND"
        _, around, forwards = bound.parameters(kind, 3)
        loop = _entity(entities, around, bound)
        uses = []
        for edge in (_entity(entities, k, loop) for k in _list(loop.parameters("EDGE_LOOP", 2)[1], loop)):
            _, _, _, curve, along = edge.parameters("ORIENTED_EDGE", 5)
            uses.append((_entity(entities, curve, edge).number, _flag(forwards, bound) == _flag(along, edge)))
        loops.append(uses if _flag(forwards, bound) else uses[::-1])
    return loops


def _gaps(entities: Entities, loop: list[tuple[int, bool]]) -> int:
    """Return how many edges of a loop do not begin at the vertex where the one before ends."""
    ends = [
        entities[number].parameters("EDGE_CURVE", 5)[1:3][:: 1 if forwards else -1]
        for number, forwards in loop
    ]
    return sum(before[1] != after[0] for before, after in zip(ends[-1:] + ends[:-1], ends))


def _face(entities: Entities, face: Entity) -> BrepFace:
    surface = _entity(entities, face.parameters("ADVANCED_FACE", 4)[2], face)
    spline: BSplineSurface | NURBSSurface | None = None
    plane = None
    if "B_SPLINE_SURFACE_WITH_KNOTS" in surface.parts:
        row = _spline_row(surface, "SURFACE", 13)
        knots = _knots(surface, row[1], row[8], row[10]), _knots(surface, row[2], row[9], row[11])
        net = _net(row[3], knots, surface)
        poles = _points(entities, [k for line in net for k in line], surface).reshape(
            knots[0].dim, knots[1].dim, 3
        )
        spline = BSplineSurface(*knots, poles)
        if "RATIONAL_B_SPLINE_SURFACE" in surface.parts:
            weights = _net(surface.parameters("RATIONAL_B_SPLINE_SURFACE", 1)[0], knots, surface)
            spline = NURBSSurface(*knots, poles, np.array([_reals(line, surface) for line in weights]))
    if "PLANE" in surface.parts:
        placement = _entity(entities, surface.parameters("PLANE", 2)[1], surface)
        _, point, axis, _ = placement.parameters("AXIS2_PLACEMENT_3D", 4)
        plane = np.stack([_points(entities, [point], placement)[0], _direction(entities, axis, placement)])
    along = {
        k: _flag(entities[k].parameters("EDGE_CURVE", 5)[4], entities[k])
        for loop in _loops(entities, face)
        for k, _ in loop
    }
    loops = tuple(tuple((k, forwards == along[k]) for k, forwards in loop) for loop in _loops(entities, face))
    outward = _flag(face.parameters("ADVANCED_FACE", 4)[3], face)
    return BrepFace(face.number, " ".join(surface.parts), spline, plane, outward, loops)


def _edge(entities: Entities, edge: Entity) -> BrepEdge:
    _, start, stop, carrier, along = edge.parameters("EDGE_CURVE", 5)
    vertices = [_entity(entities, k, edge) for k in ((start, stop) if _flag(along, edge) else (stop, start))]
    ends = _points(entities, [v.parameters("VERTEX_POINT", 2)[1] for v in vertices], edge)
    curve = _entity(entities, carrier, edge)
    # a curve with its images in the faces' parameters
    for kind in {"SURFACE_CURVE", "SEAM_CURVE"} & curve.parts.keys():
        curve = _entity(entities, curve.parameters(kind, 4)[1], curve)
    if "LINE" in curve.parts:
        _, start, along = curve.parameters("LINE", 3)
        vector = _entity(entities, along, curve)
        _, direction, length = vector.parameters("VECTOR", 3)
        point = _points(entities, [start], curve)[0]
        step = _direction(entities, direction, vector) * _reals([length], vector)[0]
        return BrepEdge(edge.number, ends, None, np.stack([point, point + step]))
    if "B_SPLINE_CURVE_WITH_KNOTS" not in curve.parts:
        return BrepEdge(edge.number, ends, None, None)
    row = _spline_row(curve, "CURVE", 9)
    kv = _knots(curve, row[1], row[6], row[7])
    poles = _list(row[2], curve)
    if len(poles) != kv.dim:
        raise ValueError(
            f"STEP entity #{curve.number} must have {kv.dim} poles by its knots, got {len(poles)}"
        )
    return BrepEdge(edge.number, ends, kv, _points(entities, poles, curve))


def _direction(entities: Entities, value: Value, user: Entity) -> Floats:
    """Return the three components of a DIRECTION."""
    direction = _entity(entities, value, user)
    row = _reals(direction.parameters("DIRECTION", 2)[1], direction)
    if len(row) != 3 or not np.isfinite(row).all() or not any(row):
        raise ValueError(f"STEP entity #{direction.number} must have three finite components, not all zero")
    return np.array(row)


def _spline_row(entity: Entity, what: str, count: int) -> list[Value]:
    """Return the parameters of a spline as those of the simple form, also where a complex one splits them."""
    base = f"B_SPLINE_{what}"
    with_knots = f"B_SPLINE_{what}_WITH_KNOTS"
    row = entity.parts[with_knots]
    if base in entity.parts:
        row = [None, *entity.parts[base], *row]
    if len(row) != count:
        raise ValueError(
            f"STEP entity #{entity.number}: {with_knots} must have {count} parameters, got {len(row)}"
        )
    return row


def _knots(entity: Entity, degree: Value, times: Value, values: Value) -> KnotVector:
    """Return the knot vector of distinct knots and how often each occurs."""
    counts = _list(times, entity)
    knots = _reals(values, entity)
    # no knot occurs more often than degree + 1 times, so that repeating them takes little memory
    whole = [n for n in [degree, *counts] if type(n) is int and 1 <= n <= 11]
    if len(whole) != 1 + len(counts) or len(counts) != len(knots):
        raise ValueError(
            f"STEP entity #{entity.number} must have as many multiplicities, from 1 to 11, as knots"
        )
    try:
        return KnotVector(whole[0], np.repeat(knots, whole[1:]))
    except ValueError as error:
        raise ValueError(f"STEP entity #{entity.number}: {error}") from None


def _net(value: Value, knots: Sequence[KnotVector], entity: Entity) -> list[list[Value]]:
    """Return rows of poles or weights, as many as the knots want."""
    rows = [_list(line, entity) for line in _list(value, entity)]
    wanted = (knots[0].dim, knots[1].dim)
    widths = {len(line) for line in rows}
    if len(rows) != wanted[0] or widths != {wanted[1]}:
        got = f"{len(rows)} x {' or '.join(map(str, sorted(widths)[:3]))}"
        raise ValueError(
            f"STEP entity #{entity.number} must have {wanted[0]} x {wanted[1]} poles by its knots, got {got}"
        )
    return rows


def _points(entities: Entities, references: Sequence[Value], user: Entity) -> Floats:
    """Return the coordinates of CARTESIAN_POINTs, (n, 3)."""
    points = [_entity(entities, k, user) for k in references]
    coordinates: list[str] = []
    for point in points:
        found = POINT.fullmatch(point.text)
        if found is None:
            raise ValueError(
                f"STEP entity #{point.number} must be a CARTESIAN_POINT of three reals, got "
                f"{point.text[:60]!r}"
            )
        coordinates.extend(found.groups())
    rows = np.fromiter(map(float, coordinates), np.float64, len(coordinates)).reshape(-1, 3)
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        raise ValueError(
            f"STEP entity #{points[int(np.argmin(finite))].number} has a coordinate that float64 cannot hold"
        )
    return rows


def _entity(entities: Entities, value: Value, user: Entity) -> Entity:
    if not isinstance(value, Reference) or value not in entities:
        raise ValueError(
            f"STEP entity #{user.number} must refer to an entity of the file, got {str(value)[:40]}"
        )
    return entities[value]


def _list(value: Value, user: Entity) -> list[Value]:
    if not isinstance(value, list):
        raise ValueError(f"STEP entity #{user.number} must have a list, got {str(value)[:40]}")
    return value


def _reals(value: Value, user: Entity) -> list[float]:
    values = _list(value, user)
    reals = [v for v in values if type(v) is float]
    if len(reals) != len(values):
        raise ValueError(f"STEP entity #{user.number} must have a list of reals")
    return reals


def _flag(value: Value, user: Entity) -> bool:
    if value not in ("T", "F"):
        raise ValueError(f"STEP entity #{user.number} must have .T. or .F., got {str(value)[:40]}")
    return value == "T"


def _text(value: Value, user: Entity) -> str:
    if not isinstance(value, str):
        raise ValueError(f"STEP entity #{user.number} must have a name, got {str(value)[:40]}")
    return value
