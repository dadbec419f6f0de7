"""Conics as CAD files hold them: planes, spheres and rational patches of revolution, cut by planes along z,
and curves in space.

With kappa = (1 + K) / (4 R^2) the map (s, t) -> (x, y, z) = (s / w, t / w, (s^2 + t^2) / (2 R w)),
w = 1 + kappa (s^2 + t^2), covers the conic without a singular point: a biquadratic patch holds it exactly.

Curves are parametrised as in ISO 10303-42. A placement has a centre C, an axis and a first direction; P3 is
the axis and P1 the part of the first direction across it, both of length 1, and P2 = P3 x P1.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats
from thbcad.sags.conic import Conic
from thbcad.splines import KnotVector, NURBSSurface

Order = Literal[0, 1]  # of a derivative
FARTHEST = 1e4  # half-widths from vertex to centre: sums of both keep 1e-11 half-widths
LEAST_WEIGHT = 0.1  # of a patch; at zero a pole is infinitely far away
ROOM = 1 + 1e-3  # of a patch: its sides stay clear of the rims
NOT_BOUNDED = (np.inf, np.inf)
FRAME = (0.0, 0.0, 1.0, 1.0, 0.0, 0.0)  # normal and first direction of planes


@dataclass(frozen=True, eq=False)
class ConicCurve:
    """A circle, an ellipse, a hyperbola or a parabola.

        circle, ellipse   C + a cos t P1 + b sin t P2
        hyperbola         C + a cosh t P1 + b sinh t P2
        parabola          C + a t^2 P1 + 2 a t P2

    kind : "CIRCLE", "ELLIPSE", "HYPERBOLA" or "PARABOLA".
    placement : (3, 3) float, rows C, axis and first direction, as the file has them; in a plane of parameters
        the third components are those of (., ., 0), (0, 0, 1) and (., ., 0).
    sizes : (a, b) float; twice the radius of a circle, twice the focal distance of a parabola.
    """

    kind: str
    placement: Floats
    sizes: Floats

    @property
    def closed(self) -> bool:
        """Whether the whole curve is closed."""
        return self.kind in ("CIRCLE", "ELLIPSE")

    def points(self, t: Floats, derivative: Order = 0) -> Floats:
        """Return the points at the parameters t, (n,), or their derivatives, (n, 3)."""
        a, b = self.sizes
        if self.closed:
            by_order = (a * np.cos(t), b * np.sin(t)), (-a * np.sin(t), b * np.cos(t))
        elif self.kind == "HYPERBOLA":
            by_order = (a * np.cosh(t), b * np.sinh(t)), (a * np.sinh(t), b * np.cosh(t))
        else:
            by_order = (a * t * t, 2 * a * t), (2 * a * t, 2 * a + 0 * t)
        along: Floats = np.stack(by_order[derivative], axis=1) @ axes(self.placement)[:2]
        return along if derivative else self.placement[0] + along

    def parameters(self, points: Floats) -> Floats:
        """Return the parameters of points of the curve, (n, 3), as (n,); angles lie within -pi to pi."""
        a, b = self.sizes
        x, y = axes(self.placement)[:2] @ (points - self.placement[0]).T
        t: Floats = y / (2 * a)
        if self.closed:
            t = np.arctan2(y / b, x / a)
        elif self.kind == "HYPERBOLA":
            t = np.arcsinh(y / b)
        return t


def axes(placement: Floats) -> Floats:
    """Return P1, P2 and P3 of a placement with rows centre, axis and first direction, (3, 3) float."""
    _, axis, first = placement
    axis = axis / np.linalg.norm(axis)
    across = first - (first @ axis) * axis
    across = across / np.linalg.norm(across)
    return np.stack([across, np.cross(axis, across), axis])


def patch_numbers(surface: NURBSSurface) -> Floats:
    """Return poles, weights and knots of a patch in one row."""
    rows = surface.coefficients, surface.weights, surface.kv_u.knots, surface.kv_v.knots
    return np.concatenate([row.ravel() for row in rows])


@dataclass(frozen=True, eq=False)
class ConicSection(ConicCurve):
    """The piece of a circle, an ellipse or a hyperbola between two parameters.

    ends : float, the parameters between which the curve runs towards increasing x or y
    """

    ends: tuple[float, float]


@dataclass(frozen=True, eq=False)
class PlacedConic:
    """A conic of revolution about z with its vertex at (0, 0, vertex), over the rectangle |x|, |y| <=
    half_width, mm.

    written : the numbers of the file from which it was read, as `numbers`; None where it is not from a file
    """

    conic: Conic
    vertex: float
    half_width: tuple[float, float] = NOT_BOUNDED
    written: Floats | None = None

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the height at (x, y), mm."""
        return self.vertex + self.conic(x, y)

    @property
    def kind(self) -> str:
        """PLANE, SPHERE or QUADRIC."""
        if self.conic.is_plane:
            return "PLANE"
        return "QUADRIC" if self.conic.constant else "SPHERE"

    @property
    def side(self) -> float:
        """The z component, 1 or -1, of the direction from the centre of curvature at the vertex to it."""
        return -1.0 if self.conic.radius > 0 else 1.0

    @property
    def centre(self) -> float:
        """The z of the centre, mm; of planes infinite."""
        return self.vertex + self.conic.radius / (1 + self.conic.constant)

    @property
    def exact(self) -> bool:
        """Whether files hold it and its rims without loss: it is no paraboloid but a plane, its centre is not
        too far away, and the weights of its patch are positive."""
        if self.kind == "PLANE":
            return True
        if self.conic.is_paraboloid or abs(self.centre - self.vertex) > FARTHEST * min(self.half_width):
            return False
        return self.kind == "SPHERE" or bool(self._weights.min() >= LEAST_WEIGHT)

    @property
    def numbers(self) -> Floats:
        """The numbers of its surface in a file.

        Of a plane point, normal and first direction; of a sphere centre, axis, first direction and radius; of
        a patch poles, weights and knots.
        """
        if self.written is not None:
            return self.written
        if self.kind == "PLANE":
            return np.array([0.0, 0.0, self.vertex, *FRAME])
        if self.kind == "SPHERE":
            return np.append(self.sphere, abs(self.conic.radius))
        return patch_numbers(self.patch)

    @property
    def sphere(self) -> Floats:
        """Centre, axis and first direction of a sphere, (3, 3): its poles lie on y and its seam opposite the
        vertex, so that neither lies on a lens."""
        return np.array([[0.0, 0.0, self.centre], [0.0, 1.0, 0.0], [0.0, 0.0, -self.side]])

    @cached_property
    def _reach(self) -> Floats:
        """The greatest |s| and |t| of the patch, mm."""
        hx, hy = self.half_width
        # from the middle of a side to its ends the slant falls on ellipsoids and rises on hyperboloids
        heights = np.array([[self.conic(hx, 0.0), self.conic(0.0, hy)], [self.conic(hx, hy)] * 2])
        reach: Floats = ROOM * 2 * np.array([hx, hy]) / (1 + self._slant(heights).min(axis=0))
        return reach

    @property
    def _weights(self) -> Floats:
        squares = np.multiply.outer(self._reach**2, [1.0, -1.0, 1.0])
        kappa = (1 + self.conic.constant) / (4 * self.conic.radius**2)
        weights: Floats = 1 + kappa * (squares[0][:, None] + squares[1][None, :])
        return weights

    @cached_property
    def patch(self) -> NURBSSurface:
        """The biquadratic patch with 3 x 3 poles over (s, t)."""
        s, t = np.multiply.outer(self._reach, [-1.0, 0.0, 1.0])
        squares = np.multiply.outer(self._reach**2, [1.0, -1.0, 1.0])
        weights = self._weights
        x, y = np.broadcast_arrays(s[:, None], t[None, :])
        z = (squares[0][:, None] + squares[1][None, :]) / (2 * self.conic.radius)
        points = np.stack([x / weights, y / weights, self.vertex + z / weights], axis=-1)
        kv_s, kv_t = (KnotVector(2, np.repeat([-end, end], 3)) for end in self._reach)
        return NURBSSurface(kv_s, kv_t, points, weights)

    def parameters(self, points: Floats) -> Floats:
        """Return the parameters in the file's surface of points on it, (n, 2): x and y of a plane, angles in
        radians of a sphere, s and t of a patch.

        points : (n, 3), mm
        """
        if self.kind == "QUADRIC":
            return 2 * points[:, :2] / (1 + self._slant(points[:, 2] - self.vertex))[:, None]
        centre, axis, first = self.numbers[:9].reshape(3, 3)
        x, y, z = np.stack([first, np.cross(axis, first), axis]) @ (points - centre).T
        if self.kind == "PLANE":
            return np.column_stack([x, y])
        return np.column_stack([np.arctan2(y, x) % (2 * np.pi), np.arctan2(z, np.hypot(x, y))])

    def _slant(self, heights: Floats) -> Floats:
        """Return sqrt(1 - (1 + K) r^2 / R^2) at heights above the vertex."""
        return 1 - (1 + self.conic.constant) * heights / self.conic.radius

    def section(self, axis: int, offset: float) -> ConicSection:
        """Return the section above the rectangle in the plane y = offset (axis 0) or x = offset (axis 1).

            t^2 + (1 + K) (z - centre)^2 = R^2 / (1 + K) - offset^2,    t = x or y

        For all but planes and paraboloids.
        """
        curved, half = 1 + self.conic.constant, self.half_width[axis]
        square = self.conic.radius**2 / curved - offset**2
        across, upright = np.sqrt(abs(square)), np.sqrt(abs(square / curved))
        centre = np.insert([offset, self.centre], axis, 0.0)
        along = np.eye(3)[axis]
        vertex = np.array([0.0, 0.0, self.side * np.sign(curved)])
        if curved < 0:
            kind, first, second, sizes = "HYPERBOLA", vertex, along, (upright, across)
            middle, reach = 0.0, np.arcsinh(half / across)
        elif across > upright:
            kind, first, second, sizes = "ELLIPSE", -along, vertex, (across, upright)
            middle, reach = np.pi / 2, np.arcsin(half / across)
        else:
            # away from the vertex, so that angles lie between 0 and 2 pi
            kind, first, second, sizes = "ELLIPSE", -vertex, -along, (upright, across)
            middle, reach = np.pi, np.arcsin(half / across)
        if self.kind == "SPHERE":
            kind = "CIRCLE"
        placement = np.stack([centre, np.cross(first, second), first]) + 0.0
        return ConicSection(kind, placement, np.array(sizes), (float(middle - reach), float(middle + reach)))
