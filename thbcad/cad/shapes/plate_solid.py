"""A plate of like lenses as an OCCT solid with shared topology: its land is a frame round all of them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, islice

from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.gp import gp_Trsf, gp_Vec
from OCP.TopoDS import TopoDS_Compound, TopoDS_Face, TopoDS_Iterator, TopoDS_Shape

from thbcad.cad.occt_names import as_face
from thbcad.cad.shapes.flange_solid import walled_lens
from thbcad.cad.shapes.topology import BUILDER, Part, closed_part
from thbcad.cad.shapes.walls import Ring, UprightWall, plane_face, wall_faces
from thbcad.lens import SIDES, edge_names, walls_of
from thbcad.moulds import FACES, Plate, named_on_plate
from thbcad.outlines import UPRIGHT


def plate_part(plate: Plate) -> Part:
    """Return a plate as a closed Part: of each lens front, rear and the edges on both sides of the land, and
    the land's own faces.

    The poles of lens k are those of the first, plus its place: x + s, rounded once.
    """
    lens = plate.lens
    planar = lens.taper == UPRIGHT
    wall, (front, bottom), (rear, top) = walled_lens(lens, walls_of(lens, None), planar)
    land = plate.low, plate.high
    below, above = (wall.level(z) for z in land)
    own = [front, rear, *wall_faces(wall, bottom, below), *wall_faces(wall, above, top)]
    edges = [f"{edge} {side}" for side in FACES for edge in edge_names(lens)]
    names: list[str] = []
    faces: list[TopoDS_Face] = []
    holes: tuple[list[Ring], list[Ring]] = ([], [])
    for number, (x, y) in enumerate(plate.places.tolist()):
        copies, *rims = _moved((own, below.edges, above.edges), (x, y))
        faces += map(as_face, copies)
        names += named_on_plate([*FACES, *edges], number)
        for ring, rim, hole in zip((below, above), rims, holes):
            hole.append(replace(ring, edges=rim))
    outline = UprightWall(plate.outline.pieces)
    rings = [outline.level(z) for z in land]
    sides_of_land = wall_faces(outline, *rings)
    walls, *rims = _moved((sides_of_land, *(ring.edges for ring in rings)), plate.middle)
    outer = [replace(ring, edges=rim) for ring, rim in zip(rings, rims)]
    faces += [plane_face(z, holes[k], outer[k], k == 1) for k, z in enumerate(land)]
    faces += map(as_face, walls)
    sides = [side.name.replace("edge", "land side") for side in SIDES]
    return closed_part([*names, "land front", "land rear", *sides], faces)


def _moved(
    rows: Sequence[Sequence[TopoDS_Shape]], place: tuple[float, float]
) -> list[Sequence[TopoDS_Shape]]:
    """Return copies of rows of shapes, which share what the shapes share, shifted in x and y, mm."""
    if not any(place):
        return [*rows]
    whole, shift = TopoDS_Compound(), gp_Trsf()
    BUILDER.MakeCompound(whole)
    for shape in chain.from_iterable(rows):
        BUILDER.Add(whole, shape)
    shift.SetTranslation(gp_Vec(*place, 0.0))
    copy = BRepBuilderAPI_Transform(whole, shift, True).Shape()  # which an iterator does not keep
    copies, moved = TopoDS_Iterator(copy), []
    while copies.More():
        moved.append(copies.Value())
        copies.Next()
    rest = iter(moved)
    return [[*islice(rest, len(row))] for row in rows]
