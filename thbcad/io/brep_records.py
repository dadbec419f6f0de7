"""Boundary representations as STEP files hold them: one solid, its faces and its edges, and their points.

Points are parametrised as ISO 10303-42 has it.  A placement has a centre C, an axis and a first direction;
P3 is the axis and P1 the part of the first direction across it, both of length 1, and P2 = P3 x P1.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from thbcad.checks import Floats
from thbcad.sags import ConicCurve, axes, lobatto_nodes
from thbcad.splines import BSplineSurface, KnotVector, NURBSCurve, NURBSSurface

MILLIMETRE = "MILLI METRE"
MATCH = 1e-7  # the distance within which edges and the sides of faces agree, as CAD programs have it in mm
NEWTON_STEPS = 20  # about 5 suffice where the point lies on the curve
TURN = 2 * np.pi
Order = Literal[0, 1]  # of a derivative
Local = tuple[Floats, Floats, Floats]  # components along P1, P2 and P3


@dataclass(frozen=True, eq=False, kw_only=True)
class BrepCurve:
    """A curve in space, d = 3, or in the parameters of a surface, d = 2.

    kv, poles : knots and poles (n, d) float of a spline.  A line has no knots; its poles are its point and
        one a vector on.  Both are None for other curves.
    weights : of the poles of a rational spline, (n,) float, else None.
    conic : where the curve is one, else None.
    """

    kv: KnotVector | None = None
    poles: Floats | None = None
    weights: Floats | None = None
    conic: ConicCurve | None = None

    @property
    def known(self) -> bool:
        """True for lines, splines and conics."""
        return self.poles is not None or self.conic is not None

    @property
    def closed_conic(self) -> bool:
        """True for circles and ellipses, whose points repeat after 2 pi."""
        return self.conic is not None and self.conic.closed

    def points(self, t: Floats, derivative: Order = 0) -> Floats:
        """Return the points of a known curve at the parameters t, (n,), or their derivatives, (n, d)."""
        if self.poles is None:
            assert self.conic is not None
            return self.conic.points(t, derivative)
        points: Floats
        if self.kv is None:
            step = self.poles[1] - self.poles[0]
            points = np.ones((len(t), 1)) * step if derivative else self.poles[0] + t[:, None] * step
        elif self.weights is not None:
            points = NURBSCurve(self.kv, self.poles, self.weights)(t, derivative)
        else:
            first, values = self.kv.basis(t, derivative)
            points = sum(v[:, None] * self.poles[first + k] for k, v in enumerate(values.T))
        return points


@dataclass(frozen=True, eq=False, kw_only=True)
class ParameterCurve(BrepCurve):
    """A PCURVE: the image of an edge in the parameters of a surface, a curve with d = 2.

    carrier : the number of the surface.
    """

    carrier: int

    def points(self, t: Floats, derivative: Order = 0) -> Floats:
        """Return points (u, v) or their derivatives, (n, 2)."""
        return super().points(t, derivative)[:, :2]


@dataclass(frozen=True, eq=False, kw_only=True)
class BrepEdge(BrepCurve):
    """An EDGE_CURVE, a curve with d = 3: ends (2, 3) float, in the direction of its curve.

    images : of the edge in the parameters of surfaces.
    """

    number: int
    ends: Floats
    images: tuple[ParameterCurve, ...] = ()


@dataclass(frozen=True, eq=False)
class Extrusion:
    """A SURFACE_OF_LINEAR_EXTRUSION: X(u, v) = curve(u) + v vector, vector (3,) float."""

    curve: BrepCurve
    vector: Floats

    def points(self, u: Floats, v: Floats, derivative: tuple[Order, Order] = (0, 0)) -> Floats:
        """Return X(u, v), X_u or X_v at points, (n,) each, as (n, 3)."""
        if derivative[1]:
            return np.ones((len(u), 1)) * self.vector
        swept = self.curve.points(u, derivative[0])
        return swept if derivative[0] else swept + v[:, None] * self.vector


@dataclass(frozen=True, eq=False, kw_only=True)
class BrepFace:
    """An ADVANCED_FACE: its number and its name in the file and the type of its surface.

    carrier : the number of its surface.
    surface : where it is a spline, else None.
    plane : where it is one, a point, the normal and the direction of the first parameter, (3, 3) float, else
        None.
    sphere, cylinder : where it is one, centre, axis, first direction and (radius, 0, 0), (4, 3) float, else
        None.
    cone : as a cylinder, with (radius, half angle, 0); the radius is that at its centre.
    extrusion : where it is one, else None.
    outward : whether the normal of the surface points out of the solid.
    loops : around the face, seen from outside to the left: edges by number, each with whether it is passed
        along its curve.
    """

    number: int
    name: str
    carrier: int
    surface_type: str
    surface: BSplineSurface | NURBSSurface | None = None
    plane: Floats | None = None
    sphere: Floats | None = None
    cylinder: Floats | None = None
    cone: Floats | None = None
    extrusion: Extrusion | None = None
    outward: bool
    loops: tuple[tuple[tuple[int, bool], ...], ...]

    @property
    def known(self) -> bool:
        """True where the points of the surface can be found."""
        kinds = (self.surface, self.plane, self.sphere, self.cylinder, self.cone, self.extrusion)
        return any(kind is not None for kind in kinds)

    @property
    def turns(self) -> tuple[bool, bool]:
        """Whether the points of the surface repeat after 2 pi, in u and in v."""
        swept = self.extrusion is not None and self.extrusion.curve.closed_conic
        ball = self.sphere is not None
        return swept or ball or self.cylinder is not None or self.cone is not None, ball

    def points(self, u: Floats, v: Floats, derivative: tuple[Order, Order] = (0, 0)) -> Floats:
        """Return X(u, v), X_u or X_v of a known surface at points, (n,) each, as (n, 3)."""
        if self.surface is not None:
            return self.surface(u, v, derivative)
        if self.extrusion is not None:
            return self.extrusion.points(u, v, derivative)
        rows = next(k for k in (self.plane, self.sphere, self.cylinder, self.cone) if k is not None)
        local = _on_plane(u, v, derivative) if self.plane is not None else self._round(u, v, derivative)
        along: Floats = np.stack(local, axis=1) @ axes(rows[:3])
        return along if any(derivative) else rows[0] + along

    def _round(self, u: Floats, v: Floats, derivative: tuple[Order, Order]) -> Local:
        """Return the components along P1, P2 and P3 of r(v) (cos u P1 + sin u P2) + h(v) P3."""
        by_u, by_v = derivative
        if self.sphere is not None:
            radius = self.sphere[3, 0]
            r, h = ((np.cos(v), np.sin(v)), (-np.sin(v), np.cos(v)))[by_v]
            r, h = radius * r, radius * h
        else:
            rows = self.cylinder if self.cylinder is not None else self.cone
            assert rows is not None
            slope = np.tan(rows[3, 1])
            r, h = ((rows[3, 0] + slope * v, v), (slope + 0 * v, 1 + 0 * v))[by_v]
        cos, sin = ((np.cos(u), np.sin(u)), (-np.sin(u), np.cos(u)))[by_u]
        return r * cos, r * sin, 0 * h if by_u else h


@dataclass(frozen=True, eq=False)
class Brep:
    """The one solid of a STEP file, in its unit of length.

    name : of the product.  unit : of length, "MILLI METRE" in files of this package.  faces : in the order of
        the shell.
    unpaired : how many edges do not border two faces, once in each direction.
    gaps : how many edges do not begin where the edge before them around a face ends.
    contradictions : how many splines say that they are closed, and are open, or that they cross themselves.
    labels : the words and numbers beside the shape, by what they say: name, author, organization and schema
        of the header, product, material, density, unit of density, uncertainty, person, company; empty where
        the file has none.
    """

    name: str
    unit: str
    faces: tuple[BrepFace, ...]
    edges: tuple[BrepEdge, ...]
    unpaired: int
    gaps: int
    contradictions: int
    labels: Mapping[str, tuple[str, ...]]


def _on_plane(u: Floats, v: Floats, derivative: tuple[Order, Order]) -> Local:
    """Return the components along P1, P2 and P3 of u P1 + v P2."""
    by_u, by_v = derivative
    zero = 0 * u
    if by_u or by_v:
        return zero + by_u, zero + by_v, zero
    return u, v, zero


def edge_span(edge: BrepEdge) -> tuple[float, float] | None:
    """Return the parameters of an edge's ends, equal ones where a line has no direction, None where the curve
    is not known."""
    if edge.conic is not None:
        first, last = edge.conic.parameters(edge.ends).tolist()
        if edge.closed_conic:
            whole = abs(edge.ends[1] - edge.ends[0]).max() <= MATCH
            last = first + (TURN if whole else (last - first) % TURN)
        return first, last
    if edge.poles is None:
        return None
    if edge.kv is not None:
        whole = abs(edge.poles[[0, -1]] - edge.ends).max() <= MATCH
        return (edge.kv.start, edge.kv.stop) if whole else _nearest(edge, edge.kv)
    step = edge.poles[1] - edge.poles[0]
    length = np.linalg.norm(step)
    if not length:
        return 0.0, 0.0
    first, last = ((edge.ends - edge.poles[0]) @ (step / length) / length).tolist()
    return first, last


def _nearest(edge: BrepEdge, kv: KnotVector) -> tuple[float, float]:
    """Return the parameters of the points of a spline that are nearest to the ends of an edge that is a part
    of it: by Gauss-Newton steps from the nearest of samples."""
    t = lobatto_nodes(kv.breaks, 2 * kv.degree)
    apart = np.linalg.norm(edge.points(t)[:, None] - edge.ends, axis=2)
    found = t[np.argmin(apart, axis=0)]
    for _ in range(NEWTON_STEPS):
        off, along = edge.points(found) - edge.ends, edge.points(found, 1)
        step = (off * along).sum(axis=1) / (along * along).sum(axis=1)
        found = np.clip(found - np.nan_to_num(step, posinf=0.0, neginf=0.0), kv.start, kv.stop)
    first, last = found.tolist()
    return first, last
