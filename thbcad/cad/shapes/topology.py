"""Vertices, edges and faces of solids, made once and shared, so that shells are closed by construction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.Geom import Geom_Line, Geom_Plane
from OCP.Geom2d import Geom2d_Line
from OCP.gp import gp_Dir, gp_Dir2d, gp_Pln, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import (
    TopoDS,
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Shell,
    TopoDS_Solid,
    TopoDS_Vertex,
    TopoDS_Wire,
)

from thbcad.cad.shapes.occt_splines import TOLERANCE, geom_curve, geom_surface
from thbcad.cad.shapes.part import Part
from thbcad.checks import Floats
from thbcad.lens import SIDES, Corner, Side, Surfaces, rim, rim_parameter, ruled_edge
from thbcad.splines import UNIT, BSplineSurface

if TYPE_CHECKING:
    from OCP.Geom import Geom_Curve
    from OCP.TopoDS import TopoDS_Shape

NAMES = ("front", "rear", *(side.name for side in SIDES))


def closed_part(names: Sequence[str], faces: Sequence[TopoDS_Face]) -> Part:
    """Return the solid between faces that share their edges and whose normals point outward."""
    builder = BRep_Builder()
    shell = TopoDS_Shell()
    solid = TopoDS_Solid()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face)
    shell.Closed(True)
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return Part(solid, tuple(names), tuple(faces))


def new_vertex(builder: BRep_Builder, point: Floats) -> TopoDS_Vertex:
    """Return a vertex at a point, (3,) float, mm."""
    vertex = TopoDS_Vertex()
    builder.MakeVertex(vertex, gp_Pnt(*point.tolist()), TOLERANCE)
    return vertex


def new_edge(
    builder: BRep_Builder,
    curve: Geom_Curve,
    first: float,
    last: float,
    start: TopoDS_Vertex,
    stop: TopoDS_Vertex,
) -> TopoDS_Edge:
    """Return the piece [first, last] of a curve between two vertices as an edge."""
    edge = TopoDS_Edge()
    builder.MakeEdge(edge, curve, TOLERANCE)
    builder.Add(edge, start)
    stop = stop.Oriented(TopAbs_REVERSED)
    builder.Add(edge, stop)
    builder.Range(edge, first, last)
    return edge


def rim_edge(
    builder: BRep_Builder, surface: BSplineSurface, side: Side, vertices: Mapping[Corner, TopoDS_Vertex]
) -> TopoDS_Edge:
    """Return the edge of a side, running towards increasing x or y."""
    kv, poles = rim(surface, side)
    ends = vertices[side.start], vertices[side.stop]
    return new_edge(builder, geom_curve(kv, poles), kv.start, kv.stop, *ends)


def strut(
    builder: BRep_Builder,
    surfaces: Surfaces,
    corner: Corner,
    vertices: Sequence[Mapping[Corner, TopoDS_Vertex]],
    straight: bool,
) -> TopoDS_Edge:
    """Return the edge from the front corner to the rear corner."""
    ends = np.array([s.coefficients[corner] for s in surfaces])
    if straight:
        length = float(np.linalg.norm(ends[1] - ends[0]))
        curve = Geom_Line(gp_Pnt(*ends[0].tolist()), gp_Dir(*(ends[1] - ends[0]).tolist()))
    else:
        length = 1.0
        curve = geom_curve(UNIT, ends)
    return new_edge(builder, curve, 0.0, length, vertices[0][corner], vertices[1][corner])


def side_line(surface: BSplineSurface, side: Side) -> Geom2d_Line:
    """Return the parameter-space line of a side of a tensor-product face."""
    fixed = rim_parameter(surface, side)
    if side.axis == 0:
        return Geom2d_Line(gp_Pnt2d(0.0, fixed), gp_Dir2d(1, 0))
    return Geom2d_Line(gp_Pnt2d(fixed, 0.0), gp_Dir2d(0, 1))


def turned(edge: TopoDS_Edge, reverse: bool) -> TopoDS_Shape:
    """Return the edge, reversed or not."""
    return edge.Reversed() if reverse else edge


def new_wire(builder: BRep_Builder, edges: Sequence[TopoDS_Shape]) -> TopoDS_Wire:
    """Return the closed wire of edges that follow each other head to tail."""
    wire = TopoDS_Wire()
    builder.MakeWire(wire)
    for edge in edges:
        builder.Add(wire, edge)
    wire.Closed(True)
    return wire


def spline_face(builder: BRep_Builder, surface: BSplineSurface, loop: Sequence[TopoDS_Shape]) -> TopoDS_Face:
    """Return the face of a spline surface within a loop of edges."""
    face = TopoDS_Face()
    builder.MakeFace(face, geom_surface(surface), TOLERANCE)
    builder.Add(face, new_wire(builder, loop))
    return face


def edge_face(
    builder: BRep_Builder,
    surfaces: Surfaces,
    side: Side,
    chains: Sequence[Sequence[TopoDS_Shape]],
    planar: bool,
) -> TopoDS_Face:
    """Return the edge face of a side, its normal outward: a plane, or a ruled face.

    chains : the edges along the front rim, the strut at its end, the rear rim (reversed) and the strut at its
        start (reversed).
    """
    make = _flat_face if planar else _ruled_face
    face = make(builder, surfaces, side, chains)
    return TopoDS.Face_s(face.Reversed()) if side.clockwise else face


def _flat_face(
    builder: BRep_Builder, surfaces: Surfaces, side: Side, chains: Sequence[Sequence[TopoDS_Shape]]
) -> TopoDS_Face:
    """Return the plane between the rims of a lens whose front and rear have the same size."""
    _, poles = rim(surfaces[0], side)
    normal = gp_Dir(0, -1, 0) if side.axis == 0 else gp_Dir(1, 0, 0)
    face = TopoDS_Face()
    builder.MakeFace(face, Geom_Plane(gp_Pln(gp_Pnt(*poles[0].tolist()), normal)), TOLERANCE)
    builder.Add(face, new_wire(builder, list(chain.from_iterable(chains))))
    return face


def _ruled_face(
    builder: BRep_Builder, surfaces: Surfaces, side: Side, chains: Sequence[Sequence[TopoDS_Shape]]
) -> TopoDS_Face:
    """Return the ruled face between two rims; its second parameter runs from front to rear."""
    ruled = ruled_edge(surfaces, side)
    face = spline_face(builder, ruled, list(chain.from_iterable(chains)))
    across, along = gp_Dir2d(0, 1), gp_Dir2d(1, 0)
    lines = [
        Geom2d_Line(gp_Pnt2d(0, 0), along),
        Geom2d_Line(gp_Pnt2d(ruled.kv_u.stop, 0), across),
        Geom2d_Line(gp_Pnt2d(0, 1), along),
        Geom2d_Line(gp_Pnt2d(ruled.kv_u.start, 0), across),
    ]
    for edges, line in zip(chains, lines):
        for edge in edges:
            builder.UpdateEdge(TopoDS.Edge_s(edge), line, face, TOLERANCE)
    return face
