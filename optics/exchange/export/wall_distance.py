"""How far points of a mesh lie from the walls of a lens: its ruled edges, or those of an outline and a
flange."""

from collections.abc import Iterator

import numpy as np
from scipy.interpolate import BSpline

from optics.exchange.export.body import Body
from thbcad.checks import Floats
from thbcad.lens import SIDES, Flange, Lens, Side, placed_surfaces, rim, walls_of
from thbcad.moulds import MouldedBody
from thbcad.outlines import Outline, Polygon


def wall_distance(lens: Lens, body: Body, samples: Iterator[tuple[str, Floats]]) -> float:
    """Return the greatest distance of points from the walls that they belong to, mm.

    samples : (name of the face, points (n, 3)) of every face but front and rear, in the order of the mesh.
    """
    if body.is_moulded and body.moulded is not None:
        made = MouldedBody.of(lens, body.moulded)
        return max(made.off_walls(*points.T) for name, points in samples if not name.startswith("radius"))
    if body.polygon is not None:
        sides = Polygon(tuple(body.polygon)).sides
        return max(_from_side(side, points) for side, (_, points) in zip(sides, samples))
    if body.aperture is None and body.flange is None:
        if not lens.rear.outline.is_rectangle:
            return max(_from_outline(lens, points) for _, points in samples)
        return max(edge_distance(lens, side, points) for side, (_, points) in zip(SIDES, samples))
    shape = walls_of(lens, body.aperture)
    return max(_distance(name, points, shape, body.flange) for name, points in samples)


def _from_outline(lens: Lens, points: Floats) -> float:
    """Return the greatest distance from the wall between the rims of a lens with an outline, of upper bounds
    in the direction of the axis: at the share w of the height from rim to rim the outline has the half-widths
    (1 - w) h_front + w h_rear."""
    unit = lens.rear.outline.scaled((1.0, 1.0))
    low, high = np.array(lens.front.half_width), np.array(lens.rear.half_width)
    w = np.full(len(points), 0.5)
    for _ in range(STEPS):
        relative = points[:, :2] / (low + w[:, None] * (high - low))
        gauge = unit.gauge(*relative.T)
        x, y = np.clip(relative.T / gauge, -1, 1)
        front, rear = lens.front(x * low[0], y * low[1]), lens.thickness + lens.rear(x * high[0], y * high[1])
        w = np.clip((points[:, 2] - front) / (rear - front), 0, 1)
    half = low + w[:, None] * (high - low)
    gauge = unit.gauge(*(points[:, :2] / half).T)
    beside = np.hypot(*points[:, :2].T) * abs(1 / gauge - 1)
    return float(np.hypot(beside, points[:, 2] - front - w * (rear - front)).max())


def _from_side(side: Floats, points: Floats) -> float:
    """Return the greatest distance from the upright wall over the side of a polygon, (2, 2)."""
    start, step = side[0], side[1] - side[0]
    relative = points[:, :2] - start
    along = np.clip(relative @ step / (step @ step), 0, 1)
    return float(np.hypot(*(relative - along[:, None] * step).T).max())


def _distance(name: str, points: Floats, shape: Outline, flange: Flange | None) -> float:
    """Return the greatest distance from the plane of a flange or from an upright wall, of upper bounds along
    the ray from the axis."""
    if flange is not None and name.startswith(("flange front", "flange rear")):
        level = flange.low if name.startswith("flange front") else flange.high
        return float(np.abs(points[:, 2] - level).max())
    if flange is not None and name.startswith("flange side"):
        shape = flange.around(shape)
    size = shape.gauge(*points[:, :2].T)
    return float((np.hypot(*points[:, :2].T) * np.abs(1 / size - 1)).max())


STEPS = 6


def edge_distance(lens: Lens, side: Side, points: Floats) -> float:
    """Return the greatest distance of points from the edge E(u, w) = F(u) + w (B(u) - F(u)) between the rims
    F and B, mm.

    The distance to any E(u, w) is an upper bound.  Gauss-Newton steps from a (u, w) of about equal height
    find the nearest point of the edge, unless it lies on the rim of a slanted edge.

    points : (n, 3), mm.
    """
    # the rims of front and rear as curves over the parameters of the rear
    rims = (rim(surface, side) for surface in placed_surfaces(lens))
    front, rear = (BSpline(kv.knots, poles, kv.degree) for kv, poles in rims)
    slopes = front.derivative(), rear.derivative()
    stop, w = rear.t[-1], np.full(len(points), 0.5)
    ratio = lens.front.half_width[side.axis] / lens.rear.half_width[side.axis]
    for _ in range(STEPS):  # about the (u, w) at which E has the height of the points
        u = np.clip(points[:, side.axis] / ((1 - w) * ratio + w), -stop, stop)
        low, high = front(u)[:, 2], rear(u)[:, 2]
        w = np.clip((points[:, 2] - low) / (high - low), 0, 1)
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
