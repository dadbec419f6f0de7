"""The lens cut to a polygon, as an OCCT solid with explicit shared topology.

Front and rear keep their whole surface, trimmed by the polygon.  Nothing is cut by Boolean operations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.Geom import Geom_Line, Geom_Plane
from OCP.gp import gp_Dir, gp_Pln, gp_Pnt
from OCP.TopoDS import TopoDS, TopoDS_Face

from thbcad.cad.shapes.occt_splines import TOLERANCE, geom_curve, geom_surface
from thbcad.cad.shapes.rings import Ring, wall_faces
from thbcad.cad.shapes.topology import closed_part, new_edge, new_vertex, new_wire
from thbcad.cad.shapes.walls import UP, trace
from thbcad.lens import Polygon, placed_surfaces, require_polygon, require_sound, side_curve
from thbcad.splines import UNIT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from OCP.Geom import Geom_Curve, Geom_Surface

    from thbcad.cad.shapes.part import Part
    from thbcad.checks import Floats
    from thbcad.lens import Lens
    from thbcad.splines import BSplineSurface, KnotVector


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
        flat = [(UNIT, np.column_stack([side, [z, z]])) for side in self.polygon.sides]
        return self.rim(builder, flat)

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
    surface: BSplineSurface = placed_surfaces(lens)[k]
    vertex = np.array([0.0, 0.0, k * lens.thickness])
    curves = [side_curve(lens.graphs()[k], *side) for side in wall.polygon.sides]
    ring = wall.rim(builder, [(kv, poles + vertex) for kv, poles in curves])
    face = TopoDS_Face()
    builder.MakeFace(face, geom_surface(surface), TOLERANCE)
    builder.Add(face, new_wire(builder, ring.edges))
    # from x and y to parameters, which are those over the rear's rectangle
    scale = np.divide(lens.rear.half_width, (lens.front, lens.rear)[k].half_width)
    for edge, side in zip(ring.edges, wall.polygon.sides):
        builder.UpdateEdge(TopoDS.Edge_s(edge), trace(UNIT, side * scale), face, TOLERANCE)
    return (face if k else TopoDS.Face_s(face.Reversed())), ring
