"""How far points lie from the ruled edges of a lens."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from thbcad.lens import Lens, Side, placed_surfaces, rim

STEPS = 6

Array = NDArray[np.float64]


def edge_distance(lens: Lens, side: Side, points: Array) -> float:
    """Return the greatest distance of points from the edge E(u, w) = F(u) + w (B(u) - F(u)) between the rims
    F and B, mm.

    The distance to any E(u, w) is an upper bound.  Gauss-Newton steps from a (u, w) of about equal height
    find the nearest point of the edge, unless it lies on the rim of a slanted edge.

    points : (n, 3), mm.
    """
    front, rear = _rims(lens, side)
    slopes = front.derivative(), rear.derivative()
    u, w = _of_equal_height(lens, side, points)
    stop = front.t[-1]
    for _ in range(STEPS):
        f, across = front(u), rear(u) - front(u)
        along = (1 - w)[:, None] * slopes[0](u) + w[:, None] * slopes[1](u)
        rest = points - f - w[:, None] * across
        aa, ab, bb, ar, br = (
            (p * q).sum(1)
            for p, q in ((along, along), (along, across), (across, across), (along, rest), (across, rest))
        )
        determinant = aa * bb - ab * ab
        u = np.clip(u + (bb * ar - ab * br) / determinant, -stop, stop)
        w = np.clip(w + (aa * br - ab * ar) / determinant, 0, 1)
    f = front(u)
    return float(np.linalg.norm(points - f - w[:, None] * (rear(u) - f), axis=1).max())


def _rims(lens: Lens, side: Side) -> list[BSpline]:
    """Return the rims of front and rear as curves over the parameters of the rear."""
    rims = [rim(surface, side) for surface in placed_surfaces(lens)]
    return [BSpline(kv.knots, poles, kv.degree) for kv, poles in rims]


def _of_equal_height(lens: Lens, side: Side, points: Array) -> tuple[Array, Array]:
    """Return about the (u, w) at which E has the height of the points, and their position along the rim."""
    axis = side.axis
    front, rear = _rims(lens, side)
    stop, w = rear.t[-1], np.full(len(points), 0.5)
    ratio = lens.front.half_width[axis] / lens.rear.half_width[axis]
    for _ in range(STEPS):
        u = np.clip(points[:, axis] / ((1 - w) * ratio + w), -stop, stop)
        low, high = front(u)[:, 2], rear(u)[:, 2]
        w = np.clip((points[:, 2] - low) / (high - low), 0, 1)
    return u, w
