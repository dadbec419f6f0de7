"""The walls of lenses and flanges: plane, elliptic and ruled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from OCP.BRep import BRep_Builder
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
from OCP.Geom2d import Geom2d_Line
from OCP.gp import gp_Ax2, gp_Ax3, gp_Dir, gp_Dir2d, gp_Pln, gp_Pnt, gp_Pnt2d

from thbcad.cad.shapes.forms import Form, ruled_trace
from thbcad.cad.shapes.occt_splines import geom_curve, geom_surface, trace
from thbcad.cad.shapes.rings import Ring
from thbcad.cad.shapes.topology import new_edge, new_vertex, turned
from thbcad.checks import Floats
from thbcad.lens import CORNERS, SIDES, Side
from thbcad.outlines import Ellipse, fitted_curve, kinks
from thbcad.splines import UNIT, BSplineSurface, KnotVector

UP = gp_Dir(0, 0, 1)


@dataclass(frozen=True, eq=False)
class PlaneWall:
    """The `Wall` of planes over a polygon; v is z.

    corners : (x, y) float, mm, counter-clockwise
    """

    corners: Sequence[tuple[float, float]]

    @classmethod
    def rectangle(cls, half_width: tuple[float, float]) -> PlaneWall:
        """Return the wall of |x| = half_width[0] and |y| = half_width[1], mm, in the order of SIDES."""
        hx, hy = half_width
        return cls([(hx if i else -hx, hy if j else -hy) for i, j in CORNERS])

    @property
    def ends(self) -> Sequence[tuple[float, float]]:
        return ((0.0, 1.0),) * len(self.corners)  # the planes face outward

    def surface(self, panel: int) -> Geom_Surface:
        (x0, y0), (x1, y1) = self.corners[panel], self.corners[(panel + 1) % len(self.corners)]
        return Geom_Plane(gp_Pln(gp_Pnt(x0, y0, 0.0), gp_Dir(y1 - y0, x0 - x1, 0.0)))

    def strut(self, corner: int) -> Geom_Curve:
        return Geom_Line(gp_Pnt(*self.corners[corner], 0.0), UP)

    def level(self, builder: BRep_Builder, z: float) -> Ring:
        points = np.column_stack([self.corners, np.full(len(self.corners), z)])
        curves = []
        for start, step in zip(points, np.roll(points, -1, axis=0) - points):
            line = Geom_Line(gp_Pnt(*start.tolist()), gp_Dir(*step.tolist()))
            curves.append((line, 0.0, float(np.linalg.norm(step))))
        return self._ring(builder, points, curves)

    def rim(self, builder: BRep_Builder, curves: Sequence[tuple[KnotVector, Floats]]) -> Ring:
        """Return the ring along splines (x, y, z), one for each side; vertices have their z as height."""
        starts = np.array([poles[0] for _, poles in curves])
        return self._ring(
            builder, starts, [(geom_curve(kv, poles), kv.start, kv.stop) for kv, poles in curves]
        )

    def _ring(
        self, builder: BRep_Builder, points: Floats, curves: Sequence[tuple[Geom_Curve, float, float]]
    ) -> Ring:
        vertices = [new_vertex(builder, point) for point in points]
        pairs = zip(vertices, [*vertices[1:], vertices[0]])
        edges = [new_edge(builder, *curve, *pair) for curve, pair in zip(curves, pairs)]
        return Ring(vertices, edges, (), points[:, 2].tolist())


@dataclass(frozen=True, eq=False)
class EllipticWall:
    """The `Wall` over an ellipse, a straight cylinder in two halves; s is the angle of the ellipse, v is
    z."""

    ellipse: Ellipse

    ends = ((0.0, np.pi), (np.pi, 2 * np.pi))

    @property
    def _round(self) -> bool:
        return self.ellipse.semi_axes[0] == self.ellipse.semi_axes[1]

    def _axes(self, z: float) -> gp_Ax2:
        return gp_Ax2(gp_Pnt(0, 0, z), UP, gp_Dir(0, 1, 0) if self.ellipse.upright else gp_Dir(1, 0, 0))

    def _curve(self, z: float) -> Geom_Curve:
        a, b = self.ellipse.semi_axes
        return (
            Geom_Circle(self._axes(z), a)
            if self._round
            else Geom_Ellipse(self._axes(z), max(a, b), min(a, b))
        )

    def _points(self, z: Sequence[float]) -> Floats:
        return np.column_stack([*self.ellipse([0.0, np.pi]), z])

    def surface(self, panel: int) -> Geom_Surface:
        if self._round:
            return Geom_CylindricalSurface(gp_Ax3(self._axes(0.0)), self.ellipse.semi_axes[0])
        return Geom_SurfaceOfLinearExtrusion(self._curve(0.0), UP)

    def strut(self, corner: int) -> Geom_Curve:
        return Geom_Line(gp_Pnt(*self._points((0.0, 0.0))[corner].tolist()), UP)

    def level(self, builder: BRep_Builder, z: float) -> Ring:
        vertices = [new_vertex(builder, point) for point in self._points((z, z))]
        edges = [
            new_edge(builder, self._curve(z), *self.ends[k], vertices[k], vertices[1 - k]) for k in (0, 1)
        ]
        return Ring(vertices, edges, (Geom2d_Line(gp_Pnt2d(0.0, z), gp_Dir2d(1, 0)),) * 2, (z, z))

    def rim(self, builder: BRep_Builder, curves: Sequence[tuple[KnotVector, Floats]]) -> Ring:
        """Return the ring along two splines (x, y, z) over the angle, one for each half."""
        heights = tuple(float(poles[0, 2]) for _, poles in curves)
        vertices = [new_vertex(builder, point) for point in self._points(heights)]
        edges = [
            new_edge(builder, geom_curve(*curves[k]), *self.ends[k], vertices[k], vertices[1 - k])
            for k in (0, 1)
        ]
        return Ring(
            vertices,
            edges,
            [trace(kv, np.column_stack([kv.greville(), poles[:, 2]])) for kv, poles in curves],
            heights,
        )


@dataclass(frozen=True, eq=False)
class RuledWall:
    """The `Wall` of the four ruled edges of a lens; s is x or y in the rear's rectangle, v runs from 0
    (front) to 1 (rear).

    panels : as `ruled_edges` returns them
    """

    panels: Sequence[BSplineSurface]

    @property
    def ends(self) -> Sequence[tuple[float, float]]:
        spans = [(panel.kv_u.start, panel.kv_u.stop) for panel in self.panels]
        return (*spans[:2], *(span[::-1] for span in spans[2:]))

    def surface(self, panel: int) -> Geom_Surface:
        return geom_surface(self.panels[panel])

    def strut(self, corner: int) -> Geom_Curve:
        return geom_curve(UNIT, self.panels[corner].coefficients[_first(SIDES[corner])])

    def rim(self, builder: BRep_Builder, form: Form, v: float) -> Ring:
        """Return the ring of the front's (v = 0) or the rear's rim (v = 1)."""
        line = Geom2d_Line(gp_Pnt2d(0.0, v), gp_Dir2d(1, 0))
        images = [
            ruled_trace(form.rim(side), side, panel, v) or line for side, panel in zip(SIDES, self.panels)
        ]
        return replace(form_ring(builder, form), traces=images, heights=(v,) * 4)

    def level(self, builder: BRep_Builder, z: float) -> Ring:
        """Return the ring at a height, (1 - v) front + v rear with v = (z - front) / (rear - front) on each
        ruling."""
        curves = [self._level(panel, z) for panel in self.panels]
        flat = [(kv, np.column_stack([poles[:, :2], np.full(len(poles), z)])) for kv, poles in curves]
        traces = [trace(kv, np.column_stack([kv.greville(), poles[:, 2]])) for kv, poles in curves]
        starts = [_first(side) for side in SIDES]
        heights = [float(poles[k, 2]) for k, (_, poles) in zip(starts, curves)]
        lines = [(geom_curve(kv, poles), (kv.start, kv.stop)) for kv, poles in flat]
        ring = _side_ring(builder, lines, [poles[k] for k, (_, poles) in zip(starts, flat)])
        return replace(ring, traces=traces, heights=heights)

    def _level(self, panel: BSplineSurface, z: float) -> tuple[KnotVector, Floats]:
        """Return knots and poles (x, y, v) of the level line of a panel."""

        def line(s: Floats) -> Floats:
            front, rear = np.moveaxis(panel.grid(s, [0.0, 1.0]), 1, 0)
            v = (z - front[:, 2]) / (rear[:, 2] - front[:, 2])
            return np.column_stack([front[:, :2] + v[:, None] * (rear - front)[:, :2], v])

        breaks, counts = kinks(panel.kv_u)
        return fitted_curve(line, np.r_[panel.kv_u.start, breaks, panel.kv_u.stop], np.r_[1, counts, 1])


def form_ring(builder: BRep_Builder, form: Form) -> Ring:
    """Return the ring along the rim of front or rear; vertices have their z as height."""
    corners = [form.corner(corner) for corner in CORNERS]
    rims = [form.rim(side) for side in SIDES]
    return _side_ring(builder, [(along.curve, along.ends) for along in rims], corners)


def _side_ring(
    builder: BRep_Builder, curves: Sequence[tuple[Geom_Curve, tuple[float, float]]], corners: Sequence[Floats]
) -> Ring:
    """Return the ring along four curves between two parameters, x or y rising, one for each side."""
    vertices = [new_vertex(builder, point) for point in corners]
    edges = []
    for k, (side, (curve, (first, last))) in enumerate(zip(SIDES, curves)):
        pair = vertices[k], vertices[(k + 1) % 4]
        ends = pair[::-1] if side.clockwise else pair
        edges.append(turned(new_edge(builder, curve, first, last, *ends), side.clockwise))
    return Ring(vertices, edges, (), [float(point[2]) for point in corners])


def _first(side: Side) -> int:
    """Return the index of the first pole of a rim, counter-clockwise."""
    return -1 if side.clockwise else 0
