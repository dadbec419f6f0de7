"""The lens cut to a polygon, as an OCCT solid with explicit shared topology.

Front and rear keep their whole surface, trimmed by the polygon.  Nothing is cut by Boolean operations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.Geom import Geom_Line, Geom_Plane
from OCP.gp import gp_Dir, gp_Pln, gp_Pnt
from OCP.TopoDS import TopoDS

from thbcad.cad.shapes.edge_faces import face_on
from thbcad.cad.shapes.forms import ConicForm, FlatForm, conic_form
from thbcad.cad.shapes.occt_splines import TOLERANCE, geom_curve, geom_surface, trace
from thbcad.cad.shapes.rings import Ring, wall_faces
from thbcad.cad.shapes.topology import closed_part, new_edge, new_vertex, turned_face
from thbcad.cad.shapes.walls import UP
from thbcad.lens import Polygon, fitted_curve, optical_forms, require_polygon, require_sound, side_curve
from thbcad.sags import PlacedConic
from thbcad.splines import UNIT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from OCP.Geom import Geom_Curve, Geom_Surface
    from OCP.TopoDS import TopoDS_Face

    from thbcad.cad.shapes.part import Part
    from thbcad.checks import Floats
    from thbcad.lens import Lens
    from thbcad.splines import KnotVector


def polygon_part(lens: Lens, corners: Sequence[tuple[float, float]]) -> Part:
    """Return the lens within a polygon as a closed Part: front, rear and a plane face on every side.

    corners : (x, y) float, mm, of a polygon as `Polygon`

    The rims are the splines that front and rear have above the sides (`side_curve`).

    Raises
    ------
    ValueError : as `require_sound` and `require_polygon`.
    """
    polygon = require_polygon(require_sound(lens), corners)
    builder = BRep_Builder()
    wall = PolygonWall(polygon)
    (front, low), (rear, high) = (_optical_face(builder, lens, wall, k) for k in (0, 1))
    names = [f"edge {k + 1}" for k in range(len(polygon.corners))]
    return closed_part(("front", "rear", *names), (front, rear, *wall_faces(builder, wall, low, high)))


@dataclass(frozen=True, eq=False)
class PolygonWall:
    """The `Wall` of planes over a polygon; v is z."""

    polygon: Polygon

    @property
    def ends(self) -> Sequence[tuple[float, float]]:
        return ((0.0, 1.0),) * len(self.polygon.corners)  # the planes face outward

    def surface(self, panel: int) -> Geom_Surface:
        start, stop = self.polygon.sides[panel]
        x, y = (stop - start).tolist()
        return Geom_Plane(gp_Pln(gp_Pnt(*start.tolist(), 0.0), gp_Dir(y, -x, 0.0)))

    def strut(self, corner: int) -> Geom_Curve:
        return Geom_Line(gp_Pnt(*self.polygon.corners[corner], 0.0), UP)

    def level(self, builder: BRep_Builder, z: float) -> Ring:
        starts = [np.array([*corner, z]) for corner in self.polygon.corners]
        vertices = [new_vertex(builder, start) for start in starts]
        edges = []
        for start, (first, last), *pair in zip(
            starts, self.polygon.sides, vertices, [*vertices[1:], vertices[0]]
        ):
            x, y = (last - first).tolist()
            line = Geom_Line(gp_Pnt(*start.tolist()), gp_Dir(x, y, 0.0))
            edges.append(new_edge(builder, line, 0.0, float(np.hypot(x, y)), *pair))
        return Ring(vertices, edges, (), (z,) * len(starts))

    def rim(self, builder: BRep_Builder, curves: Sequence[tuple[KnotVector, Floats]]) -> Ring:
        """Return the ring along splines (x, y, z), one for each side; vertices have their z as height."""
        starts = [poles[0] for _, poles in curves]
        vertices = [new_vertex(builder, start) for start in starts]
        edges = [
            new_edge(builder, geom_curve(kv, poles), kv.start, kv.stop, *pair)
            for (kv, poles), *pair in zip(curves, vertices, [*vertices[1:], vertices[0]])
        ]
        return Ring(vertices, edges, (), [float(start[2]) for start in starts])


def _optical_face(builder: BRep_Builder, lens: Lens, wall: PolygonWall, k: int) -> tuple[TopoDS_Face, Ring]:
    """Return (face, ring of its rim) of the front (k = 0) or the rear (k = 1), its normal outward."""
    surface = optical_forms(lens)[k]
    if isinstance(surface, PlacedConic):
        form = conic_form(surface)
        face, ring = _conic_face(builder, form, wall)
        return turned_face(face, form.upward != (k == 1)), ring
    vertex = np.array([0.0, 0.0, k * lens.thickness])
    curves = [side_curve(lens.graphs()[k], *side) for side in wall.polygon.sides]
    ring = wall.rim(builder, [(kv, poles + vertex) for kv, poles in curves])
    face = face_on(builder, geom_surface(surface), ring.edges)
    # from x and y to parameters, which are those over the rear's rectangle
    scale = np.divide(lens.rear.half_width, (lens.front, lens.rear)[k].half_width)
    for edge, side in zip(ring.edges, wall.polygon.sides):
        builder.UpdateEdge(TopoDS.Edge_s(edge), trace(UNIT, side * scale), face, TOLERANCE)
    return turned_face(face, k == 0), ring


def _conic_face(
    builder: BRep_Builder, form: FlatForm | ConicForm, wall: PolygonWall
) -> tuple[TopoDS_Face, Ring]:
    """Return face and ring on a conic; rims on a plane are straight, others within 1e-9 mm."""
    if isinstance(form, FlatForm):
        ring = wall.level(builder, form.conic.vertex)
        return face_on(builder, form.surface(), ring.edges), ring
    unit, once = np.array([0.0, 1.0]), np.ones(2, dtype=np.int64)
    rims = [partial(_above, form.conic, start, stop) for start, stop in wall.polygon.sides]
    ring = wall.rim(builder, [fitted_curve(rim, unit, once) for rim in rims])
    face = face_on(builder, form.surface(), ring.edges, form.upward)
    for edge, rim in zip(ring.edges, rims):
        builder.UpdateEdge(TopoDS.Edge_s(edge), form.trace(rim, (0.0, 1.0)), face, TOLERANCE)
    return face, ring


def _above(conic: PlacedConic, start: Floats, stop: Floats, t: Floats) -> Floats:
    """Return the points of a conic above a straight line, at shares t of its length, (n, 3)."""
    x, y = (start + np.outer(t, stop - start)).T
    return np.column_stack([x, y, conic(x, y)])
