"""How far points of a mesh lie from the walls of a lens: its ruled edges, or those of an outline and a
flange."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from optics.exchange.export.body import Body
from optics.exchange.export.edge_distance import edge_distance
from thbcad.checks import Floats
from thbcad.lens import SIDES, Flange, Lens, Polygon


def wall_distance(lens: Lens, body: Body, samples: Iterator[tuple[str, Floats]]) -> float:
    """Return the greatest distance of points from the walls that they belong to, mm.

    samples : (name of the face, points (n, 3)) of every face but front and rear, in the order of the mesh.
    """
    if body.polygon is not None:
        sides = Polygon(tuple(body.polygon)).sides
        return max(_from_side(side, points) for side, (_, points) in zip(sides, samples))
    if body.aperture is None and body.flange is None:
        return max(edge_distance(lens, side, points) for side, (_, points) in zip(SIDES, samples))
    half = np.array(body.aperture or lens.front.half_width)
    round_ = body.aperture is not None
    return max(_distance(name, points, half, round_, body.flange) for name, points in samples)


def _from_side(side: Floats, points: Floats) -> float:
    """Return the greatest distance from the upright wall over the side of a polygon, (2, 2)."""
    start, step = side[0], side[1] - side[0]
    relative = points[:, :2] - start
    along = np.clip(relative @ step / (step @ step), 0, 1)
    return float(np.hypot(*(relative - along[:, None] * step).T).max())


def _distance(name: str, points: Floats, half: Floats, round_: bool, flange: Flange | None) -> float:
    """Return the greatest distance from the plane of a flange or from an upright wall, of upper bounds along
    the ray from the axis."""
    if flange is not None and name.startswith(("flange front", "flange rear")):
        level = flange.low if name.startswith("flange front") else flange.high
        return float(np.abs(points[:, 2] - level).max())
    if flange is not None and name.startswith("flange side"):
        half = half + flange.width
    relative = np.abs(points[:, :2]) / half
    size = np.hypot(*relative.T) if round_ else relative.max(axis=1)
    return float((np.hypot(*points[:, :2].T) * np.abs(1 / size - 1)).max())
