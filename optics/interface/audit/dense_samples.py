"""Proven bounds of a lens beside dense samples of its surfaces, which scipy evaluates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from thbcad.checks import Floats
from thbcad.lens import Lens, Manufacturability, manufacturability
from thbcad.splines import BSplineSurface, KnotVector

SAMPLES = 1000  # in each direction
ROUNDING = 1e-12  # relative, of a sampled value


class BoundGap(NamedTuple):
    """A proven bound and the extreme of the samples.

    sign : 1 for an upper bound, -1 for a lower one.  unit : as it is written behind the number.
    """

    name: str
    bound: float
    sampled: float
    sign: int
    unit: str = " mm"

    @property
    def gap(self) -> float:
        """sign * (bound - sampled) / |sampled|, below 0 where a sample contradicts the bound."""
        if self.bound == self.sampled:
            return 0.0
        return self.sign * (self.bound - self.sampled) / abs(self.sampled)

    @property
    def holds(self) -> bool:
        return self.gap >= -ROUNDING


def bound_gaps(lens: Lens, samples: int = SAMPLES) -> list[BoundGap]:
    """Return thickness, slope and radii of curvature of a rectangular lens, proven and sampled.

    With p = z_x, q = z_y and W^2 = 1 + p^2 + q^2, the slope is atan(sqrt(p^2 + q^2)), and the curvatures are
    the eigenvalues of I^-1 II, of the fundamental forms I = [[1 + p^2, pq], [pq, 1 + q^2]] and
    II = [[z_xx, z_xy], [z_xy, z_yy]] / W.

    samples : points in each direction.
    """
    proven = manufacturability(lens)
    front, rear = lens.graphs()
    thickness = lens.thickness + _sampled(rear, samples) - _sampled(front, samples)
    gaps = [
        BoundGap("least thickness", proven.thickness.lower, float(thickness.min()), -1),
        BoundGap("greatest thickness", proven.greatest_thickness.upper, float(thickness.max()), 1),
    ]
    return [*gaps, *_gaps_of_rear(rear, proven, samples)]


def _gaps_of_rear(rear: BSplineSurface, proven: Manufacturability, samples: int) -> Iterator[BoundGap]:
    p, q, xx, xy, yy = (
        _sampled(rear, samples, orders) for orders in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    )
    slope = np.degrees(np.arctan(np.hypot(p, q))).max()
    yield BoundGap("slope of the rear", proven.rear.slope.upper, float(slope), 1, "°")
    w = np.sqrt(1 + p**2 + q**2)
    mean = ((1 + q**2) * xx - 2 * p * q * xy + (1 + p**2) * yy) / (2 * w**3)
    spread = np.sqrt(np.maximum(mean**2 - (xx * yy - xy**2) / w**4, 0.0))
    for name, curvature, radius in (
        ("concave", (mean + spread).max(), proven.rear.concave.lower),
        ("convex", -(mean - spread).min(), proven.rear.convex.lower),
    ):
        sampled = float(1 / curvature) if curvature > 0 else np.inf
        yield BoundGap(f"{name} radius of the rear", radius, sampled, -1)


def _sampled(graph: BSplineSurface, samples: int, orders: tuple[int, int] = (0, 0)) -> Floats:
    """Return derivatives of a graph on a grid over its domain, (samples, samples)."""
    along_u, along_v = (_basis(kv, samples, order) for kv, order in zip((graph.kv_u, graph.kv_v), orders))
    values: Floats = along_u @ graph.coefficients @ along_v.T
    return values


def _basis(kv: KnotVector, samples: int, order: int) -> Floats:
    """Return derivatives of the B-splines of a knot vector, (samples, functions)."""
    functions = BSpline(kv.knots, np.eye(kv.dim), kv.degree)
    values: Floats = functions(np.linspace(kv.start, kv.stop, samples), nu=order)
    return values
