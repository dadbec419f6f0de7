"""Solids as stacks of rings: closed chains of edges round the z axis, joined by walls and by plane faces.

All edges and vertices are made once and shared.  Edge k of a ring runs from vertex k to vertex k + 1,
counter-clockwise seen from +z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from OCP.BRep import BRep_Builder
from OCP.Geom import Geom_Curve, Geom_Plane, Geom_Surface
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.gp import gp_Dir, gp_Dir2d, gp_Pln, gp_Pnt, gp_Pnt2d
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex

from thbcad.cad.shapes.edge_faces import draw_on_plane
from thbcad.cad.shapes.occt_splines import TOLERANCE
from thbcad.cad.shapes.topology import new_edge, new_wire


@dataclass(frozen=True, eq=False)
class Ring:
    """A closed chain of edges.

    vertices : TopoDS_Vertex, one for every edge
    edges : oriented so that the chain runs counter-clockwise
    traces : the edges in the parameters (s, v) of the wall that they bound; None on planes
    heights : float, the parameter v of the vertices
    """

    vertices: Sequence[TopoDS_Vertex]
    edges: Sequence[TopoDS_Shape]
    traces: Sequence[Geom2d_Curve | None]
    heights: Sequence[float]


class Wall(Protocol):
    """The surfaces round an outline, one panel per edge of its rings, with parameters (s, v), v upward."""

    @property
    def ends(self) -> Sequence[tuple[float, float]]:
        """The parameter s at the first and the last vertex of every panel."""

    def surface(self, panel: int) -> Geom_Surface:
        """Return the surface of a panel."""

    def strut(self, corner: int) -> Geom_Curve:
        """Return the curve s = const through vertex `corner`, whose parameter is v."""

    def level(self, builder: BRep_Builder, z: float) -> Ring:
        """Return the ring at a height."""


def wall_faces(builder: BRep_Builder, wall: Wall, low: Ring, high: Ring) -> list[TopoDS_Face]:
    """Return the faces of a wall between two of its rings, normals outward."""
    count = len(wall.ends)
    struts = [
        new_edge(builder, wall.strut(k), low.heights[k], high.heights[k], low.vertices[k], high.vertices[k])
        for k in range(count)
    ]
    return [_panel(builder, wall, k, (low, high), (struts[k], struts[(k + 1) % count])) for k in range(count)]


def _panel(
    builder: BRep_Builder,
    wall: Wall,
    k: int,
    rings: tuple[Ring, Ring],
    struts: tuple[TopoDS_Shape, TopoDS_Shape],
) -> TopoDS_Face:
    low, high = rings
    face = TopoDS_Face()
    builder.MakeFace(face, wall.surface(k), TOLERANCE)
    wire = new_wire(builder, [low.edges[k], struts[1], high.edges[k].Reversed(), struts[0].Reversed()])
    inward = wall.ends[k][0] > wall.ends[k][1]  # s runs clockwise
    builder.Add(face, wire.Reversed() if inward else wire)
    draw_on_plane(builder, face, [low.edges[k], high.edges[k]])
    images = [(TopoDS.Edge_s(ring.edges[k]), ring.traces[k]) for ring in rings]
    if low.traces[k] is not None:
        for edge, image in images:
            builder.UpdateEdge(edge, image, face, TOLERANCE)
        for s, strut in zip(wall.ends[k], struts):
            builder.UpdateEdge(strut, Geom2d_Line(gp_Pnt2d(s, 0.0), gp_Dir2d(0, 1)), face, TOLERANCE)
    return TopoDS.Face_s(face.Reversed()) if inward else face


def plane_face(builder: BRep_Builder, z: float, inner: Ring, outer: Ring, upward: bool) -> TopoDS_Face:
    """Return the plane face between two rings at a height, its normal along +z or -z."""
    face = TopoDS_Face()
    builder.MakeFace(face, Geom_Plane(gp_Pln(gp_Pnt(0, 0, z), gp_Dir(0, 0, 1))), TOLERANCE)
    builder.Add(face, new_wire(builder, outer.edges))
    builder.Add(face, new_wire(builder, [edge.Reversed() for edge in reversed(inner.edges)]))
    draw_on_plane(builder, face, [*outer.edges, *inner.edges])
    return face if upward else TopoDS.Face_s(face.Reversed())
