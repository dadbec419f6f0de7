"""Vertices, edges and faces of solids, made once and shared, so that shells are closed by construction, and
the solid whose faces have names, as CAD files show them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.Geom import Geom_Curve, Geom_Line
from OCP.Geom2d import Geom2d_Line
from OCP.gp import gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import (
    TopoDS,
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Shape,
    TopoDS_Shell,
    TopoDS_Solid,
    TopoDS_Vertex,
    TopoDS_Wire,
)

from thbcad.cad.shapes.occt_splines import TOLERANCE, geom_curve
from thbcad.checks import Floats
from thbcad.lens import SIDES, Side, rim_parameter
from thbcad.splines import UNIT, BSplineSurface

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Face, TopoDS_Solid

NAMES = ("front", "rear", *(side.name for side in SIDES))


@dataclass(frozen=True, eq=False)
class Part:
    """A solid and its faces in the order in which they were added.

    solid : TopoDS_Solid, mm
    names : of the faces; the first word says what a face is: front, rear, edge or flange
    faces : TopoDS_Face, as they lie in the solid (orientation included)
    """

    solid: TopoDS_Solid
    names: Sequence[str]
    faces: Sequence[TopoDS_Face]


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


def strut(
    builder: BRep_Builder, ends: Sequence[Floats], vertices: Sequence[TopoDS_Vertex], straight: bool
) -> TopoDS_Edge:
    """Return the edge from a front corner to the rear corner.

    ends : their points, (3,) float, mm.  straight : as a line, else as a spline of degree 1 over [0, 1]
    """
    if straight:
        step = ends[1] - ends[0]
        length = float(np.linalg.norm(step))
        curve = Geom_Line(gp_Pnt(*ends[0].tolist()), gp_Dir(*step.tolist()))
    else:
        length = 1.0
        curve = geom_curve(UNIT, np.stack(ends))
    return new_edge(builder, curve, 0.0, length, *vertices)


def side_line(surface: BSplineSurface, side: Side) -> Geom2d_Line:
    """Return the parameter-space line of a side of a tensor-product face."""
    fixed = rim_parameter(surface, side)
    if side.axis == 0:
        return Geom2d_Line(gp_Pnt2d(0.0, fixed), gp_Dir2d(1, 0))
    return Geom2d_Line(gp_Pnt2d(fixed, 0.0), gp_Dir2d(0, 1))


def turned(edge: TopoDS_Edge, reverse: bool) -> TopoDS_Shape:
    """Return the edge, reversed or not."""
    return edge.Reversed() if reverse else edge


def turned_face(face: TopoDS_Face, reverse: bool) -> TopoDS_Face:
    """Return the face, reversed or not."""
    return TopoDS.Face_s(face.Reversed()) if reverse else face


def new_wire(builder: BRep_Builder, edges: Sequence[TopoDS_Shape]) -> TopoDS_Wire:
    """Return the closed wire of edges that follow each other head to tail."""
    wire = TopoDS_Wire()
    builder.MakeWire(wire)
    for edge in edges:
        builder.Add(wire, edge)
    wire.Closed(True)
    return wire
