"""The walls of lenses and flanges, upright and ruled, between rings: closed chains of edges round the z axis.

All edges and vertices are made once and shared.  Edge k of a ring runs from vertex k to vertex k + 1,
counter-clockwise seen from +z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from OCP.Geom import (
    Geom_Circle,
    Geom_Curve,
    Geom_CylindricalSurface,
    Geom_Ellipse,
    Geom_Line,
    Geom_Plane,
    Geom_Surface,
    Geom_SurfaceOfLinearExtrusion,
)
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.gp import gp_Ax2, gp_Ax3, gp_Dir, gp_Dir2d, gp_Pln, gp_Pnt, gp_Pnt2d
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape, TopoDS_Vertex

from thbcad.cad.shapes.forms import Form, ruled_trace
from thbcad.cad.shapes.occt_splines import geom_curve, geom_surface, trace
from thbcad.cad.shapes.topology import (
    BUILDER,
    draw_on_plane,
    face_on,
    new_edge,
    new_vertex,
    new_wire,
    turned,
    turned_face,
)
from thbcad.checks import Floats
from thbcad.lens import CORNERS, SIDES, Lens, Rim, ruled_edges
from thbcad.outlines import Arc, Line, RimPiece, fitted_curve, kinks
from thbcad.splines import UNIT, BSplineSurface, KnotVector

UP = gp_Dir(0, 0, 1)
Bounded = tuple[Geom_Curve, float, float]  # a curve, its first and its last parameter


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


class Panels(Protocol):
    """The surfaces round an outline, one panel per edge of its rings, with parameters (s, v), v upward."""

    @property
    def ends(self) -> Sequence[tuple[float, float]]:
        """The parameter s at the first and the last vertex of every panel."""

    def surface(self, panel: int) -> Geom_Surface:
        """Return the surface of a panel."""

    def strut(self, corner: int) -> Geom_Curve:
        """Return the curve s = const through vertex `corner`, whose parameter is v."""


class Wall(Panels, Protocol):
    """`Panels` that can be cut at a height."""

    def level(self, z: float) -> Ring:
        """Return the ring at a height."""


def wall_faces(wall: Panels, low: Ring, high: Ring) -> list[TopoDS_Face]:
    """Return the faces of a wall between two of its rings, normals outward."""
    count = len(wall.ends)
    struts = [
        new_edge(wall.strut(k), low.heights[k], high.heights[k], low.vertices[k], high.vertices[k])
        for k in range(count)
    ]
    return [_panel(wall, k, (low, high), (struts[k], struts[(k + 1) % count])) for k in range(count)]


def _panel(
    wall: Panels,
    k: int,
    rings: tuple[Ring, Ring],
    struts: tuple[TopoDS_Shape, TopoDS_Shape],
) -> TopoDS_Face:
    low, high = rings
    inward = wall.ends[k][0] > wall.ends[k][1]  # s runs clockwise
    loop = [low.edges[k], struts[1], high.edges[k].Reversed(), struts[0].Reversed()]
    images: tuple[Geom2d_Curve | None, ...] = ()
    if low.traces[k] is not None:
        start, stop = (Geom2d_Line(gp_Pnt2d(s, 0.0), gp_Dir2d(0, 1)) for s in wall.ends[k])
        images = low.traces[k], stop, high.traces[k], start
    return turned_face(face_on(wall.surface(k), loop, not inward, images), inward)


def plane_face(z: float, holes: Sequence[Ring], outer: Ring, upward: bool) -> TopoDS_Face:
    """Return the plane face between an outer ring and the rings of holes at a height, its normal along +z or
    -z."""
    face = face_on(Geom_Plane(gp_Pln(gp_Pnt(0, 0, z), UP)), outer.edges)
    for hole in holes:
        BUILDER.Add(face, new_wire([edge.Reversed() for edge in reversed(hole.edges)]))
        draw_on_plane(face, hole.edges)
    return turned_face(face, not upward)


@dataclass(frozen=True, eq=False)
class UprightWall:
    """The `Wall` over the pieces of an outline: planes over lines, cylinders over arcs; s is the parameter of
    the piece, v is z."""

    pieces: Sequence[RimPiece]

    @property
    def ends(self) -> Sequence[tuple[float, float]]:
        return [piece.ends for piece in self.pieces]

    def surface(self, panel: int) -> Geom_Surface:
        piece = self.pieces[panel]
        if isinstance(piece, Line):
            (x0, y0), (x1, y1) = piece.start, piece.stop
            return Geom_Plane(gp_Pln(gp_Pnt(x0, y0, 0.0), gp_Dir(y1 - y0, x0 - x1, 0.0)))
        if piece.is_round:
            return Geom_CylindricalSurface(gp_Ax3(_axes(piece, 0.0)), piece.semi_axes[0])
        return Geom_SurfaceOfLinearExtrusion(level_curve(piece, 0.0)[0], UP)

    def strut(self, corner: int) -> Geom_Curve:
        return Geom_Line(gp_Pnt(*start_of(self.pieces[corner], 0.0).tolist()), UP)

    def level(self, z: float) -> Ring:
        starts = [start_of(piece, z) for piece in self.pieces]
        curves = [level_curve(piece, z) for piece in self.pieces]
        image = Geom2d_Line(gp_Pnt2d(0.0, z), gp_Dir2d(1, 0))
        return traced(ring_along(curves, starts), self.pieces, [image] * len(curves))

    def rim(self, rims: Sequence[Rim]) -> Ring:
        """Return the ring along splines (x, y, z) over the pieces; vertices have their z as height."""
        starts = [start_of(piece, float(poles[0, 2])) for piece, (_, poles) in zip(self.pieces, rims)]
        curves = [(geom_curve(*own), own[0].start, own[0].stop) for own in rims]
        images = [trace(kv, np.column_stack([kv.greville(), poles[:, 2]])) for kv, poles in rims]
        return traced(ring_along(curves, starts), self.pieces, images)


def start_of(piece: RimPiece, z: float) -> Floats:
    """Return the point of a piece at its first parameter, at a height, (3,), mm."""
    x, y = piece(np.array(piece.ends[:1]))
    return np.array([x[0], y[0], z])


def _axes(arc: Arc, z: float) -> gp_Ax2:
    longer = gp_Dir(0, 1, 0) if arc.upright else gp_Dir(1, 0, 0)
    return gp_Ax2(gp_Pnt(*arc.centre, z), UP, longer)


def level_curve(piece: RimPiece, z: float) -> Bounded:
    """Return a piece at a height, with its first and its last parameter: a line, a circle or an ellipse."""
    if isinstance(piece, Line):
        start, step = np.array([*piece.start, z]), np.array([*np.subtract(piece.stop, piece.start), 0.0])
        line = Geom_Line(gp_Pnt(*start.tolist()), gp_Dir(*step.tolist()))
        return line, 0.0, float(np.linalg.norm(step))
    longer, shorter = max(piece.semi_axes), min(piece.semi_axes)
    axes = _axes(piece, z)
    conic = Geom_Circle(axes, longer) if piece.is_round else Geom_Ellipse(axes, longer, shorter)
    return conic, *piece.ends


@dataclass(frozen=True, eq=False)
class RuledWall:
    """The `Wall` of ruled edges; s is the parameter of the rims, v runs from 0 (front) to 1 (rear).

    panels : as `ruled_edges` returns them.  clockwise : of each, whether s runs so
    """

    panels: Sequence[BSplineSurface]
    clockwise: Sequence[bool]

    @classmethod
    def of(cls, lens: Lens) -> RuledWall:
        """Return the wall of a lens whose front and rear differ in size; of a rectangular one s is x or y in
        the rear's rectangle."""
        panels = ruled_edges(lens)
        rectangular = lens.rear.outline.is_rectangle
        return cls(panels, [side.clockwise for side in SIDES] if rectangular else [False] * len(panels))

    @property
    def ends(self) -> Sequence[tuple[float, float]]:
        spans = [(panel.kv_u.start, panel.kv_u.stop) for panel in self.panels]
        return [span[::-1] if turned else span for span, turned in zip(spans, self.clockwise)]

    def surface(self, panel: int) -> Geom_Surface:
        return geom_surface(self.panels[panel])

    def strut(self, corner: int) -> Geom_Curve:
        return geom_curve(UNIT, self.panels[corner].coefficients[-1 if self.clockwise[corner] else 0])

    def sides(self, form: Form, v: float) -> Ring:
        """Return the ring along the sides of the front (v = 0) or the rear (v = 1) of a rectangular lens."""
        line = Geom2d_Line(gp_Pnt2d(0.0, v), gp_Dir2d(1, 0))
        images = [
            ruled_trace(form.rim(side), side, panel, v) or line for side, panel in zip(SIDES, self.panels)
        ]
        return replace(form_ring(form), traces=images, heights=(v,) * 4)

    def along(self, rims: Sequence[Rim], v: float) -> Ring:
        """Return the ring along the rims between which the panels are ruled, of the front (v = 0) or the rear
        (v = 1)."""
        curves = [(geom_curve(*own), own[0].start, own[0].stop) for own in rims]
        ring = ring_along(curves, [poles[0] for _, poles in rims])
        line = Geom2d_Line(gp_Pnt2d(0.0, v), gp_Dir2d(1, 0))
        return replace(ring, traces=(line,) * len(rims), heights=(v,) * len(rims))

    def level(self, z: float) -> Ring:
        """Return the ring at a height, (1 - v) front + v rear with v = (z - front) / (rear - front) on each
        ruling."""
        curves = [self._level(panel, z) for panel in self.panels]
        flat = [(kv, np.column_stack([poles[:, :2], np.full(len(poles), z)])) for kv, poles in curves]
        traces = [trace(kv, np.column_stack([kv.greville(), poles[:, 2]])) for kv, poles in curves]
        starts = [-1 if turned else 0 for turned in self.clockwise]
        heights = [float(poles[k, 2]) for k, (_, poles) in zip(starts, curves)]
        lines = [(geom_curve(kv, poles), kv.start, kv.stop) for kv, poles in flat]
        ring = ring_along(lines, [poles[k] for k, (_, poles) in zip(starts, flat)], self.clockwise)
        return replace(ring, traces=traces, heights=heights)

    def _level(self, panel: BSplineSurface, z: float) -> tuple[KnotVector, Floats]:
        """Return knots and poles (x, y, v) of the level line of a panel."""

        def line(s: Floats) -> Floats:
            front, rear = np.moveaxis(panel.grid(s, [0.0, 1.0]), 1, 0)
            v = (z - front[:, 2]) / (rear[:, 2] - front[:, 2])
            return np.column_stack([front[:, :2] + v[:, None] * (rear - front)[:, :2], v])

        breaks, counts = kinks(panel.kv_u)
        return fitted_curve(line, np.r_[panel.kv_u.start, breaks, panel.kv_u.stop], np.r_[1, counts, 1])


def form_ring(form: Form) -> Ring:
    """Return the ring along the sides of front or rear; vertices have their z as height."""
    curves = [(along.curve, *along.ends) for along in map(form.rim, SIDES)]
    corners = [form.corner(corner) for corner in CORNERS]
    return ring_along(curves, corners, [side.clockwise for side in SIDES])


def ring_along(curves: Sequence[Bounded], starts: Sequence[Floats], clockwise: Sequence[bool] = ()) -> Ring:
    """Return the ring along curves from start to start; vertices have their z as height.

    clockwise : of each curve, whether it runs so; none do where this is empty
    """
    vertices = [new_vertex(point) for point in starts]
    edges = []
    for k, (curve, reverse) in enumerate(zip(curves, clockwise or [False] * len(curves))):
        pair = vertices[k], vertices[(k + 1) % len(vertices)]
        edges.append(turned(new_edge(*curve, *(pair[::-1] if reverse else pair)), reverse))
    return Ring(vertices, edges, (None,) * len(edges), [float(point[2]) for point in starts])


def traced(ring: Ring, pieces: Sequence[RimPiece], images: Sequence[Geom2d_Curve]) -> Ring:
    """Return a ring with images of its edges in a wall over pieces, whose planes, over lines, need none."""
    return replace(ring, traces=[None if isinstance(p, Line) else image for p, image in zip(pieces, images)])
