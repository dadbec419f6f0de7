"""The solid of a STEP file, from its text: faces and edges with their splines, length unit, name."""

from __future__ import annotations

import gc
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path

from thbcad.io.brep_records import MATCH, Brep, BrepEdge, BrepFace, ParameterCurve
from thbcad.io.step_text import (
    Entities,
    Entity,
    Typed,
    Value,
    entities_of_text,
    having,
    header_of_text,
    read_file,
)
from thbcad.io.step_values import (
    cone,
    curve_of,
    entities_of,
    entity_of,
    extrusion,
    flag_of,
    in_radians,
    list_of,
    placed,
    points_of,
    radians_of,
    reals_of,
    spline_row,
    spline_surface,
    text_of,
)

PLACED = ("MAPPED_ITEM", "ITEM_DEFINED_TRANSFORMATION", "CARTESIAN_TRANSFORMATION_OPERATOR_3D")
Header = Mapping[str, Sequence[Value]]
SCHEMA_NAME = re.compile(r"(\w+)\W.*", re.ASCII | re.DOTALL)
LABELS = {  # what words and numbers beside the shape say, and the entity in which they stand
    "product": "PRODUCT",
    "material": "DESCRIPTIVE_REPRESENTATION_ITEM",
    "density": "MEASURE_REPRESENTATION_ITEM",
    "unit of density": "DERIVED_UNIT_ELEMENT",
    "uncertainty": "UNCERTAINTY_MEASURE_WITH_UNIT",
    "person": "PERSON",
    "company": "ORGANIZATION",
}
OTHER_SOLIDS = ("BREP_WITH_VOIDS", "FACETED_BREP", "SHELL_BASED_SURFACE_MODEL")


def parse_brep(path: str | Path) -> Brep:
    """Read the one solid of a STEP file from its text, without OCCT; numbers come bit for bit.

    Raises OSError : the file cannot be read.
    Raises ValueError : as `read_part21`; not one solid, moved by a placement, or an entity of it that is not
        as ISO 10303-42 wants it.
    """
    before = gc.isenabled()
    gc.disable()  # Python would search the many values for reference cycles, of which there are none
    try:
        header, entities = read_file(path)
        try:
            return brep(entities, header)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
    finally:
        if before:
            gc.enable()


def brep_of_text(text: str) -> Brep:
    """Return the one solid of a STEP file's text; raise ValueError as `parse_brep`."""
    return brep(entities_of_text(text), header_of_text(text))


def brep(entities: Entities, header: Header) -> Brep:
    """Return the one solid of a file's entities and its header; raise ValueError as `parse_brep`."""
    names = [text_of(e.parameters("PRODUCT", 4)[0], e) for e in having(entities, "PRODUCT")]
    placed = [e for kind in PLACED for e in having(entities, kind)]
    if placed:
        raise ValueError(f"the solid is moved by the placement #{placed[0].number}")
    shell = _shell(entities)
    loops = [loop for face in shell for loop in _loops(entities, face)]
    count = Counter(chain.from_iterable(loops))
    numbers = dict.fromkeys(number for number, _ in count)
    unpaired = sum(not count[number, True] == count[number, False] == 1 for number in numbers)
    radians = radians_of(entities, _units(entities, "PLANE_ANGLE_UNIT", "plane angles", 0))
    return Brep(
        name=" ".join(names),
        unit=length_unit(entities),
        faces=tuple(_face(entities, face, radians) for face in shell),
        edges=tuple(_edge(entities, entities[number], radians) for number in numbers),
        unpaired=unpaired,
        gaps=sum(_gaps(entities, loop) for loop in loops),
        contradictions=_contradictions(entities),
        labels=_labels(entities, header),
    )


def length_unit(entities: Entities) -> str:
    """Return the unit of length in which the solid is given: "MILLI METRE", "METRE", or the name of a
    converted unit.

    Raises ValueError : the solid stands in no representation, or that has not one unit of length.
    """
    (unit,) = _units(entities, "LENGTH_UNIT", "length")
    if "CONVERSION_BASED_UNIT" in unit.parts:
        return text_of(unit.parameters("CONVERSION_BASED_UNIT", 2)[0], unit)
    return " ".join(text_of(part, unit) for part in unit.parameters("SI_UNIT", 2) if part is not None)


def _units(entities: Entities, kind: str, what: str, least: int = 1) -> list[Entity]:
    """Return the units of a kind in the representation of the solid, at most one; raise ValueError as
    `length_unit`."""
    solid = _solid(entities).number
    for shape in having(entities, "ADVANCED_BREP_SHAPE_REPRESENTATION"):
        _, items, context = shape.parameters("ADVANCED_BREP_SHAPE_REPRESENTATION", 3)
        if solid in list_of(items, shape):
            (units,) = entity_of(entities, context, shape).parameters("GLOBAL_UNIT_ASSIGNED_CONTEXT", 1)
            found = [unit for unit in entities_of(entities, units, shape) if kind in unit.parts]
            if not least <= len(found) <= 1:
                raise ValueError(
                    f"the representation #{shape.number} must have one unit of {what}, got {len(found)}"
                )
            return found
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
    shell = entity_of(entities, solid.parameters("MANIFOLD_SOLID_BREP", 2)[1], solid)
    faces = entities_of(entities, shell.parameters("CLOSED_SHELL", 2)[1], shell)
    if len({face.number for face in faces}) != len(faces):
        raise ValueError(f"the shell #{shell.number} names a face twice")
    return faces


def _loops(entities: Entities, face: Entity) -> list[list[tuple[int, bool]]]:
    """Return the loops around a face: edges, each with whether it is passed forwards."""
    loops = []
    for bound in entities_of(entities, face.parameters("ADVANCED_FACE", 4)[1], face):
        kind = "FACE_OUTER_BOUND" if "FACE_OUTER_BOUND" in bound.parts else "FACE_BOUND"
        _, around, forwards = bound.parameters(kind, 3)
        loop = entity_of(entities, around, bound)
        uses = []
        for edge in entities_of(entities, loop.parameters("EDGE_LOOP", 2)[1], loop):
            _, _, _, carrier, along = edge.parameters("ORIENTED_EDGE", 5)
            curve = entity_of(entities, carrier, edge)
            uses.append((curve.number, flag_of(forwards, bound) == flag_of(along, edge)))
        loops.append(uses if flag_of(forwards, bound) else uses[::-1])
    return loops


def _gaps(entities: Entities, loop: list[tuple[int, bool]]) -> int:
    """Return how many edges of a loop do not begin at the vertex where the one before ends."""
    ends = [
        entities[number].parameters("EDGE_CURVE", 5)[1:3][:: 1 if forwards else -1]
        for number, forwards in loop
    ]
    return sum(before[1] != after[0] for before, after in zip(ends[-1:] + ends[:-1], ends))


def _face(entities: Entities, face: Entity, radians: float) -> BrepFace:
    """Return a face; radians : how many the unit of angles has."""
    name, _, carrier, same = face.parameters("ADVANCED_FACE", 4)
    surface = entity_of(entities, carrier, face)
    around = _loops(entities, face)
    along = {
        k: flag_of(entities[k].parameters("EDGE_CURVE", 5)[4], entities[k])
        for loop in around
        for k, _ in loop
    }
    loops = tuple(tuple((k, forwards == along[k]) for k, forwards in loop) for loop in around)
    return BrepFace(
        number=face.number,
        name=name if isinstance(name, str) else "",
        carrier=surface.number,
        surface_type=" ".join(surface.parts),
        surface=spline_surface(entities, surface),
        plane=placed(entities, surface, "PLANE"),
        sphere=placed(entities, surface, "SPHERICAL_SURFACE", 1),
        cylinder=placed(entities, surface, "CYLINDRICAL_SURFACE", 1),
        cone=cone(entities, surface, radians),
        extrusion=extrusion(entities, surface),
        outward=flag_of(same, face),
        loops=loops,
    )


def _edge(entities: Entities, edge: Entity, radians: float) -> BrepEdge:
    _, start, stop, carrier, along = edge.parameters("EDGE_CURVE", 5)
    both = (start, stop) if flag_of(along, edge) else (stop, start)
    vertices = [entity_of(entities, k, edge) for k in both]
    ends = points_of(entities, [v.parameters("VERTEX_POINT", 2)[1] for v in vertices], edge)
    curve = entity_of(entities, carrier, edge)
    images = []
    # a curve with its images in the faces' parameters
    for kind in {"SURFACE_CURVE", "SEAM_CURVE"} & curve.parts.keys():
        _, space, others, _ = curve.parameters(kind, 4)
        images = entities_of(entities, others, curve)
        curve = entity_of(entities, space, curve)
    flat = tuple(_image(entities, image, radians) for image in images if "PCURVE" in image.parts)
    shape = curve_of(entities, curve)
    return BrepEdge(number=edge.number, ends=ends, images=flat, **vars(shape))


def _image(entities: Entities, image: Entity, radians: float) -> ParameterCurve:
    _, carrier, drawn = image.parameters("PCURVE", 3)
    items = entity_of(entities, drawn, image)
    curves = list_of(items.parameters("DEFINITIONAL_REPRESENTATION", 3)[1], items)
    if len(curves) != 1:
        raise items.wrong(f" must have one curve, got {len(curves)}")
    surface = entity_of(entities, carrier, image)
    shape = in_radians(curve_of(entities, entity_of(entities, curves[0], items), 2), surface, radians)
    return ParameterCurve(carrier=surface.number, **vars(shape))


def _contradictions(entities: Entities) -> int:
    """Return how many splines say that they are closed, and have other poles at either end, or that they
    cross themselves."""
    count = 0
    for surface in having(entities, "B_SPLINE_SURFACE_WITH_KNOTS"):
        row = spline_row(surface, "SURFACE", 13)
        net = [_poles(line, surface) for line in _poles(row[3], surface)]
        ends = (net[0], net[-1]), ([line[0] for line in net], [line[-1] for line in net])
        closed = [pair for pair, flag in zip(ends, row[5:7]) if flag == "T"]
        count += row[7] == "T" or any(_apart(entities, surface, pair) for pair in closed)
    for curve in having(entities, "B_SPLINE_CURVE_WITH_KNOTS"):
        row = spline_row(curve, "CURVE", 9)
        poles = _poles(row[2], curve)
        count += row[5] == "T" or (row[4] == "T" and _apart(entities, curve, ([poles[0]], [poles[-1]])))
    return count


def _poles(value: Value, spline: Entity) -> list[Value]:
    """Return a row of poles; raise ValueError for an empty one."""
    if poles := list_of(value, spline):
        return poles
    raise spline.wrong(" must have poles")


def _apart(entities: Entities, user: Entity, ends: Sequence[Sequence[Value]]) -> bool:
    """Return whether two rows of points lie apart."""
    points = ([entity_of(entities, k, user) for k in row] for row in ends)
    first, last = ([reals_of(p.parameters("CARTESIAN_POINT", 2)[1], p) for p in row] for row in points)
    return any(abs(a - b) > MATCH for p, q in zip(first, last) for a, b in zip(p, q))


def _labels(entities: Entities, header: Header) -> dict[str, tuple[str, ...]]:
    """Return the words of a file, by what they say."""
    name, _, author, organization, *_ = [*header.get("FILE_NAME", ()), None, None, None, None]
    schemas = [*header.get("FILE_SCHEMA", ()), None][0]
    return {
        "name": _words(name),
        "author": _words(author),
        "organization": _words(organization),
        # what stands behind a schema's name is its number
        "schema": tuple(SCHEMA_NAME.sub(r"\1", word) for word in _words(schemas)),
        **{
            label: tuple(sorted(chain.from_iterable(_plain(e.parts[kind]) for e in having(entities, kind))))
            for label, kind in LABELS.items()
        },
    }


def _words(value: Value) -> tuple[str, ...]:
    """Return the strings of a value, a string or a list of such."""
    values = value if isinstance(value, list) else [value]
    return tuple(v for v in values if isinstance(v, str))


def _plain(values: Sequence[Value]) -> Iterator[str]:
    """Yield the texts and numbers of an entity, but no references."""
    for value in values:
        if isinstance(value, Typed):
            yield from _plain(value.parameters)
        elif isinstance(value, str | float) and value != "":
            yield str(value)
