"""Coordinates of a receiver in which a surface sends light by optimal transport with the cost X . q.

A surface z(X) needs the slopes s(X, y) to send light from X to y = (u, v).  With G = ds / dy on the way of
the light, and its incoming directions, the map X -> q(y), dq = G dy, is to be the gradient of a potential.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import map_coordinates

from optics.base.runtime import UserError
from optics.designing.starts.rear_light import LEAST_WEIGHT, RearLight
from optics.light.refraction import ShapedSurface, normalised
from thbcad.checks import Floats

Pair: TypeAlias = Any  # of numbers or arrays of any shape
STEP = 1e-3  # of the half-widths, and of a direction: for differences
# ratio of the solid angles of equal areas of the receiver, from which on a projection is too coarse
FORESHORTENED = 2.0
SAMPLES = 41  # of a chart that is integrated, in each direction
NODES = 6  # of Gauss-Legendre
NEWTON_STEPS = 6


@dataclass(frozen=True, eq=False)
class TransportChart:
    """to : q of (u, v).  back : (u, v) of q.  Pairs of arrays of any shape."""

    to: Callable[[Pair], Pair]
    back: Callable[[Pair], Pair]


@dataclass(frozen=True, eq=False)
class Middle:
    """The middle of the light on a surface, and the rectangle of the receiver that is lit.

    height : (nx, ny) mm, of the surface.  point, along : (3,), where the middle lies, and its direction.
    centre, half : of the rectangle in u and v.
    """

    shaped: ShapedSurface
    light: RearLight
    height: Floats
    point: Floats
    along: Floats
    centre: tuple[float, float]
    half: tuple[float, float]

    @classmethod
    def of(
        cls,
        shaped: ShapedSurface,
        light: RearLight,
        height: Floats,
        centre: tuple[float, float],
        half: tuple[float, float],
    ) -> Middle:
        """Return the middle: the cell next to the light's centre of mass."""
        rows = (light.x, light.flux.sum(axis=1)), (light.y, light.flux.sum(axis=0))
        i, j = (int(np.argmin(abs(row - np.average(row, weights=w)))) for row, w in rows)
        point, along = np.array([light.x[i], light.y[j], height[i, j]]), [d[i, j] for d in light.direction]
        return cls(shaped, light, height, point, np.array(along), centre, half)

    def chart(self, crosses: bool) -> TransportChart:
        """Return the chart that suits the case, with q growing where light lands that does not cross.

        Parallel light to the far field: the slopes that the middle needs, which is exact.  A receiver that is
        seen about alike all over: the perspective projection from the middle, exact for a plane across the
        axis.  Else G is integrated along the way.
        """
        if self.shaped.rest.receiver.far_field and self.light.parallel:
            chart = TransportChart(self._slopes, lambda q: self.shaped.landing(self.point, self.along, q))
        else:
            chart = self._integrated() if self._foreshortening() > FORESHORTENED else self._projected()
        # parallel light that leaves the surface aside lands aside as this does, but for a factor
        sense = np.sign(np.trace(self._derivative(self._slopes) @ self._spreading())) or 1.0
        sense = -sense if crosses else sense
        return TransportChart(
            lambda y: [sense * a for a in chart.to(y)], lambda q: chart.back([sense * a for a in q])
        )

    def _slopes(self, y: Pair) -> Pair:
        return self.shaped.slopes(self.point, self.along, y)[0]

    def _toward(self, y: Pair) -> Floats:
        return np.array(self.shaped.rest.toward(self.point, *y)[0])

    def _derivative(self, function: Callable[[Pair], Pair], at: Pair = (0.0, 0.0)) -> Floats:
        """Return the derivative of a function of (u, v), (2, 2).  at : place, relative to the rectangle."""
        place = np.array(self.centre) + np.array(at) * self.half
        steps = STEP * np.diag(self.half)
        ends = [(np.array(function(place + s)), np.array(function(place - s)), s.sum()) for s in steps]
        return np.stack([(a - b) / (2 * s) for a, b, s in ends], axis=-1)

    def _spreading(self) -> Floats:
        """Return how far light lands aside that leaves the middle a little aside, (2, 2)."""
        axis = self._toward(np.array(self.centre))

        def landed(step: Floats) -> Floats:
            return np.array(self.shaped.rest.land(self.point, normalised(axis + step))[:2])

        return np.stack([(landed(s) - landed(-s)) / (2 * STEP) for s in STEP * np.eye(3)[:2]], axis=-1)

    def _frame(self) -> Floats:
        """Return rows: two directions across the axis from the middle to the rectangle's, and the axis."""
        axis = self._toward(np.array(self.centre))
        first = np.array(normalised(np.cross((0.0, 1.0, 0.0), axis)))
        return np.array([first, np.cross(axis, first), axis])

    def _perspective(self, y: Pair) -> Floats:
        p, q, r = np.tensordot(self._frame(), self._toward(y), 1)
        return np.array([p / r, q / r])

    def _foreshortening(self) -> float:
        """Return the ratio of the greatest and the least solid angle of equal areas.

        Raises UserError : there is none of some.
        """
        places = [(a, b) for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0)]
        with np.errstate(invalid="ignore", divide="ignore"):  # at right angles to the way
            sizes = [abs(np.linalg.det(self._derivative(self._perspective, place))) for place in places]
        if not min(sizes) > 0:
            raise UserError(
                "the target is seen edge-on from the surface that is to send light to it; change target.tilt "
                "or target.position"
            )
        return float(max(sizes) / min(sizes))

    def _projected(self) -> TransportChart:
        """Return the chart of G times the perspective projection."""
        frame = self._frame()
        scale = self._derivative(self._slopes) @ np.linalg.inv(self._derivative(self._perspective))
        inverse = np.linalg.inv(scale)

        def back(q: Pair) -> Pair:
            across = np.tensordot(inverse, np.array(q), 1)
            along = np.tensordot(frame.T, np.array([*across, np.ones_like(q[0])]), 1)
            return self.shaped.rest.land(self.point, normalised(along))[:2]

        return TransportChart(lambda y: np.tensordot(scale, self._perspective(y), 1), back)

    def _integrated(self) -> TransportChart:
        """Return the chart of G, integrated from the centre to (u, v), while X goes along uncrossed.

        X keeps the proportions of `_spreading`, and the light its area for the whole rectangle.
        """
        rows = [c + h * np.linspace(-1, 1, SAMPLES) for c, h in zip(self.centre, self.half)]
        centre = np.reshape(self.centre, (2, 1, 1))
        y = np.array(np.meshgrid(*rows, indexing="ij")) - centre
        moved = np.linalg.inv(self._spreading())
        cell = (self.light.x[1] - self.light.x[0]) * (self.light.y[1] - self.light.y[0])
        lit = cell * (self.light.weight > LEAST_WEIGHT).sum() / (4 * self.half[0] * self.half[1])
        moved *= np.sqrt(lit / abs(np.linalg.det(moved)))
        q = np.zeros_like(y)
        for node, weight in zip(*np.polynomial.legendre.leggauss(NODES)):
            at = (node + 1) / 2 * y
            points, along = self._light_at(np.tensordot(moved, at, 1) + self.point[:2, None, None])
            for axis, half in enumerate(self.half):
                step = STEP * half * np.eye(2)[axis][:, None, None]
                ends = [self.shaped.slopes(points, along, centre + at + k * step)[0] for k in (1, -1)]
                q += weight / 2 * (np.array(ends[0]) - np.array(ends[1])) / (2 * STEP * half) * y[axis]
        return _interpolated(rows, q)

    def _light_at(self, x: Floats) -> tuple[list[Floats], list[Floats]]:
        """Return points of the surface, and directions of the light there.  x : (2, ...)."""
        rows = self.light.x, self.light.y
        x = np.array([np.clip(a, row[0], row[-1]) for a, row in zip(x, rows)])
        at = [(a - row[0]) / (row[1] - row[0]) for a, row in zip(x, rows)]
        height, *along = (
            map_coordinates(g, at, order=1, mode="nearest") for g in (self.height, *self.light.direction)
        )
        return [*x, height], normalised(along)


def _interpolated(rows: Sequence[Floats], q: Floats) -> TransportChart:
    """Return the chart of q, (2, n, m), on a grid of u and v; back by Newton's method within the grid."""
    splines = [RectBivariateSpline(*rows, a) for a in q]
    middle = [float(row.mean()) for row in rows]

    def jacobian(y: Pair) -> Floats:
        return np.array([[s.ev(*y, dx=1), s.ev(*y, dy=1)] for s in splines])

    def to(y: Pair) -> Pair:
        return [s.ev(*y) for s in splines]

    def back(wanted: Pair) -> Pair:
        left = [w - m for w, m in zip(wanted, to(middle))]
        y = [m + s for m, s in zip(middle, np.tensordot(np.linalg.inv(jacobian(middle)), np.array(left), 1))]
        for _ in range(NEWTON_STEPS):
            y = [np.clip(a, row[0], row[-1]) for a, row in zip(y, rows)]
            (a, b), (c, d) = jacobian(y)
            p, r = (w - g for w, g in zip(wanted, to(y)))
            y = [y[0] + (d * p - b * r) / (a * d - b * c), y[1] + (a * r - c * p) / (a * d - b * c)]
        return y

    return TransportChart(to, back)
