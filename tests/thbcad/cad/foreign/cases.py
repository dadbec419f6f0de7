"""Round lenses as other programs write them: revolved from a meridian, in one or several parts; sags and
volumes come from formulas, not from a CAD kernel."""

from dataclasses import dataclass, field
from itertools import pairwise

import build123d as bd
import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeSolid, BRepBuilderAPI_Sewing
from OCP.BRepLib import BRepLib
from OCP.BRepPrimAPI import BRepPrimAPI_MakeRevol
from OCP.GC import GC_MakeArcOfCircle
from OCP.Geom import Geom_BezierCurve
from OCP.GeomAPI import GeomAPI_Interpolate
from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt

from thbcad.cad.occt_names import PointArray, as_shell

try:
    from OCP.collections import HArray1_gp_Pnt as PointHandles
except ImportError:  # before 8.0
    from OCP.TColgp import TColgp_HArray1OfPnt as PointHandles

AXIS = gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))
SPLINE_POINTS = 81  # of an interpolated meridian


@dataclass(frozen=True)
class Meridian:
    """z(r) = c r^2 / (1 + sqrt(1 - (1 + K) c^2 r^2)) + sum_i a_i r^(4 + 2 i), mm."""

    radius: float = np.inf
    constant: float = 0.0
    terms: tuple = ()

    def __call__(self, r):
        c = 1 / self.radius
        z = c * r**2 / (1 + np.sqrt(1 - (1 + self.constant) * c**2 * r**2))
        return z + sum(a * r ** (4 + 2 * i) for i, a in enumerate(self.terms))

    def edge(self, start, stop, shift):
        """The curve from r = start to stop in the plane y = 0: a line, an arc, a polynomial or a spline."""
        r = np.linspace(start, stop, SPLINE_POINTS)
        points = [gp_Pnt(x, 0, z) for x, z in zip(r.tolist(), (self(r) + shift).tolist())]
        if np.isinf(self.radius) and not self.terms:
            return BRepBuilderAPI_MakeEdge(points[0], points[-1]).Edge()
        if not self.terms and self.constant == 0:
            return BRepBuilderAPI_MakeEdge(
                GC_MakeArcOfCircle(points[0], points[len(points) // 2], points[-1]).Value()
            ).Edge()
        if self.constant == -1:
            return BRepBuilderAPI_MakeEdge(self._bezier(start, stop, shift)).Edge()
        array = PointHandles(1, len(points))
        for k, point in enumerate(points, 1):
            array.SetValue(k, point)
        spline = GeomAPI_Interpolate(array, False, 1e-9)
        spline.Perform()
        return BRepBuilderAPI_MakeEdge(spline.Curve()).Edge()

    def _bezier(self, start, stop, shift):
        """The polynomial as a Bezier curve: values at its nodes determine the poles."""
        degree = 2 + 2 * len(self.terms)
        t = np.linspace(0, 1, degree + 1)
        basis = np.array(
            [
                [np.prod([1, *((degree - m) / (m + 1) for m in range(k))]) * s**k * (1 - s) ** (degree - k)
                 for k in range(degree + 1)]
                for s in t
            ]
        )  # fmt: skip
        r = start + (stop - start) * t
        heights = np.linalg.solve(basis, self(r) + shift)
        poles = PointArray(1, degree + 1)
        for k, (x, z) in enumerate(zip(r.tolist(), heights.tolist()), 1):
            poles.SetValue(k, gp_Pnt(x, 0, z))
        return Geom_BezierCurve(poles)


def integral(f, radius):
    """2 pi times the integral of f(r) r dr from 0 to a radius."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    r = radius * (nodes + 1) / 2
    return float(2 * np.pi * (radius / 2) * (weights * f(r) * r).sum())


@dataclass(frozen=True)
class RoundLens:
    """A round lens: front and rear, the distance of their vertices, the radius of its rim, mm."""

    front: Meridian
    rear: Meridian
    thickness: float
    radius: float
    wall: tuple = field(default=())  # points (r, z) of the wall between the rims, from front to rear

    @property
    def rims(self):
        """(r, z) of both rims."""
        return [
            (self.radius, self.front(self.radius)),
            (self.radius, self.thickness + self.rear(self.radius)),
        ]

    @property
    def corners(self):
        """(r, z) of the wall, rims included."""
        return [self.rims[0], *self.wall, self.rims[1]]

    @property
    def volume(self):
        """mm^3, within the rims."""
        return integral(lambda r: self.thickness + self.rear(r) - self.front(r), self.radius)

    @property
    def solid_volume(self):
        """mm^3, with what the wall holds: frusta of cones over the cylinder of the rims."""
        return self.volume + sum(
            np.pi * (d - b) * ((a * a + a * c + c * c) / 3 - self.radius**2)
            for (a, b), (c, d) in pairwise(self.corners)
        )

    def scaled(self, size):
        """The same lens, larger."""

        def meridian(one):
            terms = tuple(a / size ** (3 + 2 * i) for i, a in enumerate(one.terms))
            return Meridian(one.radius * size, one.constant, terms)

        wall = tuple((r * size, z * size) for r, z in self.wall)
        return RoundLens(
            meridian(self.front), meridian(self.rear), self.thickness * size, self.radius * size, wall
        )

    def turned(self):
        """The same lens seen from the other side."""

        def meridian(one):
            return Meridian(-one.radius, one.constant, tuple(-a for a in one.terms))

        wall = tuple((r, self.thickness - z) for r, z in reversed(self.wall))
        return RoundLens(meridian(self.rear), meridian(self.front), self.thickness, self.radius, wall)

    def meridian(self):
        """The edges of the half section in the plane y = 0, from the front's vertex to the rear's."""
        corners = [gp_Pnt(r, 0, z) for r, z in self.corners]
        return [
            self.front.edge(0.0, self.radius, 0.0),
            *(BRepBuilderAPI_MakeEdge(a, b).Edge() for a, b in pairwise(corners)),
            self.rear.edge(self.radius, 0.0, self.thickness),
        ]

    def solid(self, parts=1, seam=0.0):
        """The solid, whose surfaces have so many equal faces, the first seam at an angle in degrees."""
        sewing = BRepBuilderAPI_Sewing(1e-6)
        for k in range(parts):
            turn = bd.Location((0, 0, 0), (0, 0, seam + 360 * k / parts)).wrapped
            for edge in self.meridian():
                sewing.Add(BRepPrimAPI_MakeRevol(edge.Moved(turn), AXIS, 2 * np.pi / parts).Shape())
        sewing.Perform()
        solid = BRepBuilderAPI_MakeSolid(as_shell(sewing.SewedShape())).Solid()
        BRepLib.OrientClosedSolid_s(solid)
        return bd.Solid(solid)
