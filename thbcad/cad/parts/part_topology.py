"""What of a part belongs to the lens in it, and where its optical faces end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools
from OCP.GeomAbs import GeomAbs_Line
from OCP.TopAbs import TopAbs_WIRE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape

from thbcad.cad.exchange import edges_of, explore
from thbcad.cad.parts.faces_in_regions import on_face, real_edges
from thbcad.cad.parts.numbers_of_surfaces import surface_numbers
from thbcad.cad.parts.search import APART, OPTICAL
from thbcad.cad.shapes import lens_part
from thbcad.checks import Floats
from thbcad.lens import Lens

ON_EDGE = 33  # points of an edge that show whether a face lies within another
OF_CURVE = 512  # segments of a curved edge


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
            points = np.concatenate([edge_points(edge, ON_EDGE) for edge in real_edges(face)])
            if numbers.same_points(wanted, APART) and on_face(edge_face, points).all():
                found.add(number)
    return frozenset(found)


def rim_faces(faces: Sequence[TopoDS_Face], optical: Sequence[int]) -> frozenset[int]:
    """Return the faces of a part, by number, that have an edge in common with an outer wire of the optical
    ones."""
    rim = TopTools_IndexedMapOfShape()
    for number in optical:
        for edge in edges_of(BRepTools.OuterWire_s(faces[number])):
            rim.Add(edge)
    return frozenset(number for number, face in enumerate(faces) if any(map(rim.Contains, edges_of(face))))


def inner_wires(face: TopoDS_Face) -> list[TopoDS_Shape]:
    """Return the wires of a face within its outer one."""
    outer = BRepTools.OuterWire_s(face)
    return [wire for wire in explore(face, TopAbs_WIRE) if not wire.IsSame(outer)]


def outline_segments(face: TopoDS_Face) -> Floats:
    """Return the edges of a face in x and y as segments, (n, 2, 2), mm; curves are 512 of them."""
    rows = []
    for edge in real_edges(face):
        straight = BRepAdaptor_Curve(edge).GetType() == GeomAbs_Line
        points = edge_points(edge, 2 if straight else OF_CURVE + 1)[:, :2]
        rows.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(rows)


def edge_points(edge: TopoDS_Edge, count: int) -> Floats:
    """Return points of an edge at equal steps of its parameter, both ends included, (count, 3), mm."""
    curve = BRepAdaptor_Curve(edge)
    steps = np.linspace(curve.FirstParameter(), curve.LastParameter(), count)
    return np.array([curve.Value(t).Coord() for t in steps.tolist()])
