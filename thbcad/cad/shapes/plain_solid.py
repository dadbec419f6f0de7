"""The lens as an OCCT solid with explicit shared topology.

Vertices, edges and faces are made once and shared, so that the shell is closed by
construction: 8 vertices, 12 edges, 6 faces.  Nothing is sewn.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
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
from thbcad.sags import graph_poles
from thbcad.splines import BSplineSurface, KnotVector

if TYPE_CHECKING:
    from OCP.Geom import Geom_Curve
    from OCP.TopoDS import TopoDS_Shape

    from thbcad.lens import Lens

CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))  # counter-clockwise seen from +z; 0 and 1 are low and high x, y
SIDES = ((0, 1), (1, 2), (3, 2), (0, 3))  # corners of each side in the direction of increasing x or y
NAMES = ("front", "rear", "edge -y", "edge +x", "edge +y", "edge -x")
UNIT = KnotVector(1, [0.0, 0.0, 1.0, 1.0])


def lens_surfaces(lens: Lens) -> tuple[BSplineSurface, BSplineSurface]:
    """Return front and rear as BSplineSurfaces with poles (x, y, z) in the lens frame, in mm.

    Both are parametrised over the rear's rectangle, so that their rims can be ruled.
    """
    front, rear = lens.graphs()
    return graph_poles(front, 0.0, rear), graph_poles(rear, lens.thickness, rear)


def lens_solid(lens: Lens) -> TopoDS_Solid:
    """Return the lens as a closed TopoDS_Solid of six faces."""
    return lens_part(lens).solid


def lens_part(lens: Lens) -> Part:
    """Return the lens as a closed Part of six faces: front, rear and the edges at low y, high x, high y, low
    x."""
    surfaces = lens_surfaces(lens)
    planar = lens.front.half_width == lens.rear.half_width
    builder = BRep_Builder()
    vertices = [[new_vertex(builder, s.coefficients[-a, -b]) for a, b in CORNERS] for s in surfaces]
    rims = [[_rim(builder, s, side, corners) for side in range(4)] for s, corners in zip(surfaces, vertices)]
    struts = [strut(builder, surfaces, k, vertices, planar) for k in range(4)]

    faces = []
    for k, surface in enumerate(surfaces):
        face = spline_face(builder, surface, [turned(rims[k][side], side >= 2) for side in range(4)])
        for side in range(4):
            builder.UpdateEdge(rims[k][side], side_line(surface, side), face, TOLERANCE)
        # the normal of the parametrisation points to +z: outward at the rear, inward at the front
        faces.append(face if k == 1 else TopoDS.Face_s(face.Reversed()))
    for side in range(4):
        start, stop = SIDES[side]
        loop = [rims[0][side], struts[stop], rims[1][side].Reversed(), struts[start].Reversed()]
        face = (
            flat_face(builder, surfaces, side, loop)
            if planar
            else ruled_face(builder, surfaces, side, [[edge] for edge in loop])
        )
        faces.append(face if side < 2 else TopoDS.Face_s(face.Reversed()))
    return closed_part(NAMES, faces)


def closed_part(names: Sequence[str], faces: Sequence[TopoDS_Face]) -> Part:
    """Return the solid between faces that share their edges and whose normals point outward."""
    builder, shell, solid = BRep_Builder(), TopoDS_Shell(), TopoDS_Solid()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face)
    shell.Closed(True)
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return Part(solid, tuple(names), tuple(faces))


def new_vertex(builder: BRep_Builder, point: NDArray[np.float64]) -> TopoDS_Vertex:
    """Return a vertex at a point, (3,) float, mm."""
    vertex = TopoDS_Vertex()
    builder.MakeVertex(vertex, gp_Pnt(*point.tolist()), TOLERANCE)
    return vertex


def boundary(surface: BSplineSurface, side: int) -> tuple[KnotVector, NDArray[np.float64]]:
    """Return (KnotVector, poles) of a side: 0 low y, 1 high x, 2 high y, 3 low x."""
    c = surface.coefficients
    along_x = side in (0, 2)
    return (
        (surface.kv_u, c[:, 0 if side == 0 else -1]) if along_x else (surface.kv_v, c[-1 if side == 1 else 0])
    )


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


def _rim(
    builder: BRep_Builder, surface: BSplineSurface, side: int, vertices: Sequence[TopoDS_Vertex]
) -> TopoDS_Edge:
    """Return the edge of a side, running towards increasing x or y."""
    kv, poles = boundary(surface, side)
    start, stop = SIDES[side]
    return new_edge(builder, geom_curve(kv, poles), kv.start, kv.stop, vertices[start], vertices[stop])


def strut(
    builder: BRep_Builder,
    surfaces: Sequence[BSplineSurface],
    corner: int,
    vertices: Sequence[Sequence[TopoDS_Vertex]],
    straight: bool,
) -> TopoDS_Edge:
    """Return the edge from the front corner to the rear corner."""
    a, b = CORNERS[corner]
    ends = np.array([s.coefficients[-a, -b] for s in surfaces])
    if straight:
        length = float(np.linalg.norm(ends[1] - ends[0]))
        curve = Geom_Line(gp_Pnt(*ends[0].tolist()), gp_Dir(*(ends[1] - ends[0]).tolist()))
    else:
        length, curve = 1.0, geom_curve(UNIT, ends)
    return new_edge(builder, curve, 0.0, length, vertices[0][corner], vertices[1][corner])


def side_line(surface: BSplineSurface, side: int) -> Geom2d_Line:
    """Return the parameter-space line of a side of a tensor-product face."""
    ku, kv = surface.kv_u, surface.kv_v
    if side in (0, 2):
        return Geom2d_Line(gp_Pnt2d(0.0, kv.start if side == 0 else kv.stop), gp_Dir2d(1, 0))
    return Geom2d_Line(gp_Pnt2d(ku.stop if side == 1 else ku.start, 0.0), gp_Dir2d(0, 1))


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


def flat_face(
    builder: BRep_Builder, surfaces: Sequence[BSplineSurface], side: int, loop: Sequence[TopoDS_Shape]
) -> TopoDS_Face:
    """Return the plane edge face of a lens whose front and rear have the same size."""
    _, poles = boundary(surfaces[0], side)
    normal = gp_Dir(0, -1, 0) if side in (0, 2) else gp_Dir(1, 0, 0)
    face = TopoDS_Face()
    builder.MakeFace(face, Geom_Plane(gp_Pln(gp_Pnt(*poles[0].tolist()), normal)), TOLERANCE)
    builder.Add(face, new_wire(builder, loop))
    return face


def ruled_face(
    builder: BRep_Builder,
    surfaces: Sequence[BSplineSurface],
    side: int,
    chains: Sequence[Sequence[TopoDS_Shape]],
) -> TopoDS_Face:
    """Return the ruled face between two rims; its second parameter runs from front to rear.

    chains : the edges along the front rim, the strut at its end, the rear rim (reversed) and the strut at its
        start (reversed).
    """
    rims = [boundary(s, side) for s in surfaces]
    kv = rims[0][0].merged(rims[1][0])
    poles = np.stack([own.prolongation(kv) @ points for own, points in rims], axis=1)
    face = spline_face(builder, BSplineSurface(kv, UNIT, poles), list(chain.from_iterable(chains)))
    across, along = gp_Dir2d(0, 1), gp_Dir2d(1, 0)
    lines = [
        Geom2d_Line(gp_Pnt2d(0, 0), along),
        Geom2d_Line(gp_Pnt2d(kv.stop, 0), across),
        Geom2d_Line(gp_Pnt2d(0, 1), along),
        Geom2d_Line(gp_Pnt2d(kv.start, 0), across),
    ]
    for edges, line in zip(chains, lines):
        for edge in edges:
            builder.UpdateEdge(TopoDS.Edge_s(edge), line, face, TOLERANCE)
    return face
