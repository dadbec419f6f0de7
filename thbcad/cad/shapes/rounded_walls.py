"""Rounded edges of moulded bodies as OCCT faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from OCP.Geom import Geom_Curve, Geom_Surface
from OCP.Geom2d import Geom2d_Line
from OCP.gp import gp_Dir2d, gp_Pnt2d
from OCP.TopoDS import TopoDS_Face

from thbcad.cad.shapes.occt_splines import geom_curve, rational_geom, rational_geom_curve
from thbcad.cad.shapes.walls import Ring, ring_along, wall_faces
from thbcad.moulds import RoundedEdge
from thbcad.splines import NURBSCurve


@dataclass(frozen=True, eq=False)
class RoundedWall:
    """The `Panels` of a rounded edge; s is the parameter of the outline, v runs upward from 0 to 1."""

    edge: RoundedEdge

    @property
    def ends(self) -> Sequence[tuple[float, float]]:
        return [piece.kv.domain for piece in self.edge.pieces]

    def surface(self, panel: int) -> Geom_Surface:
        return rational_geom(self.edge.surfaces[panel])

    def strut(self, corner: int) -> Geom_Curve:
        surface = self.edge.surfaces[corner]
        arc = NURBSCurve(surface.kv_v, surface.coefficients[0], surface.weights[0])
        return rational_geom_curve(arc)

    def rim(self) -> Ring:
        """Return the ring along which it ends at the front or rear."""
        rims = self.edge.on_surface.rims
        curves = [(geom_curve(kv, poles), *kv.domain) for kv, poles in rims]
        return ring_along(curves, [poles[0] for _, poles in rims])

    def between(self, rim: Ring, foot: Ring) -> list[TopoDS_Face]:
        """Return its faces between the rings at the front or rear and at the wall, normals outward."""
        low, high = (foot, rim) if self.edge.number else (rim, foot)
        return wall_faces(self, _at(low, 0.0), _at(high, 1.0))


def _at(ring: Ring, v: float) -> Ring:
    line = Geom2d_Line(gp_Pnt2d(0.0, v), gp_Dir2d(1, 0))
    count = len(ring.edges)
    return replace(ring, traces=(line,) * count, heights=(v,) * count)
