"""What of a part belongs to the lens in it, and where its optical faces end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools
from OCP.GeomAbs import GeomAbs_Line
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_WIRE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape

from thbcad.cad.exchange import explore
from thbcad.cad.parts.faces_in_regions import on_face
from thbcad.cad.parts.numbers_of_surfaces import surface_numbers
from thbcad.cad.parts.search import APART, OPTICAL
from thbcad.cad.shapes import lens_part
from thbcad.checks import Floats
from thbcad.lens import Lens

ON_EDGE = 33  # points of an edge that show whether a face lies within another
OF_CURVE = 512  # segments of a curved edge


def solid_faces(solid: TopoDS_Shape) -> list[TopoDS_Face]:
    """Return the faces of a solid in their order."""
    return [TopoDS.Face_s(face) for face in explore(solid, TopAbs_FACE)]


def own_edges(faces: Sequence[TopoDS_Face], lens: Lens) -> frozenset[int]:
    """Return which faces of a part in the frame of its lens, by number, are edges of the lens or pieces of
    them: their surfaces are the same, and 33 points of each of their edges lie in the lens's face."""
    part = lens_part(lens)
    edges = [face for name, face in zip(part.names, part.faces) if name not in OPTICAL]
    own = [(face, surface_numbers(BRep_Tool.Surface_s(face))) for face in edges]
    found = set()
    for number, face in enumerate(faces):
        numbers = surface_numbers(BRep_Tool.Surface_s(face))
        for edge_face, wanted in own:
            if numbers.same_points(wanted, APART) and on_face(edge_face, _edge_points(face)).all():
                found.add(number)
    return frozenset(found)


def _edge_points(face: TopoDS_Face) -> Floats:
    """Return 33 points of every edge of a face, (n, 3), mm."""
    return np.concatenate([_points(edge, ON_EDGE) for edge in _edges(face)])


def rim_faces(faces: Sequence[TopoDS_Face], optical: Sequence[int]) -> frozenset[int]:
    """Return the faces of a part, by number, that have an edge in common with an outer wire of the optical
    ones."""
    rim = TopTools_IndexedMapOfShape()
    for number in optical:
        for edge in explore(BRepTools.OuterWire_s(faces[number]), TopAbs_EDGE):
            rim.Add(edge)
    return frozenset(
        number for number, face in enumerate(faces) if any(map(rim.Contains, explore(face, TopAbs_EDGE)))
    )


def inner_wires(face: TopoDS_Face) -> list[TopoDS_Shape]:
    """Return the wires of a face within its outer one."""
    outer = BRepTools.OuterWire_s(face)
    return [wire for wire in explore(face, TopAbs_WIRE) if not wire.IsSame(outer)]


def outline_segments(face: TopoDS_Face) -> Floats:
    """Return the edges of a face in x and y as segments, (n, 2, 2), mm; curves are 512 of them."""
    rows = []
    for edge in _edges(face):
        straight = BRepAdaptor_Curve(edge).GetType() == GeomAbs_Line
        points = _points(edge, 2 if straight else OF_CURVE + 1)[:, :2]
        rows.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(rows)


def _edges(face: TopoDS_Face) -> list[TopoDS_Edge]:
    edges = map(TopoDS.Edge_s, explore(face, TopAbs_EDGE))
    return [edge for edge in edges if not BRep_Tool.Degenerated_s(edge)]


def _points(edge: TopoDS_Edge, count: int) -> Floats:
    curve = BRepAdaptor_Curve(edge)
    steps = np.linspace(curve.FirstParameter(), curve.LastParameter(), count)
    return np.array([curve.Value(t).Coord() for t in steps.tolist()])
