"""Polygons in the plane z = 0."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Bools, Floats, floats
from thbcad.outlines.pieces import LEAST_SIZE, Line

MOST_CORNERS = 1000  # every pair of sides is looked at
FARTHEST = 1e6  # mm of a corner; rounding is then still far below LEAST_SIZE


@dataclass(frozen=True)
class Polygon:
    """A polygon in the plane z = 0, convex or not, that does not touch itself.

    corners : at least three (x, y) float, mm; they are stored counter-clockwise

    Raises ValueError : corners that are no numbers up to 1e6 mm, fewer than 3 or more than 1000; sides that
        cross or come within 1e-6 mm of each other.
    """

    corners: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        rows = _corners(self.corners)
        _require_simple(rows)
        if _shoelace(rows) < 0:
            rows = rows[::-1]
        object.__setattr__(self, "corners", tuple((float(x), float(y)) for x, y in rows))

    @property
    def area(self) -> float:
        """The area within, mm^2."""
        return _shoelace(np.array(self.corners))

    def contains(self, x: ArrayLike, y: ArrayLike) -> Bools:
        """Return which points lie inside, of their shape: rays to +x cross an odd number of sides."""
        x, y = np.broadcast_arrays(floats(x), floats(y))
        inside = np.zeros(x.shape, dtype=bool)
        for (x0, y0), (x1, y1) in self.sides.tolist():
            if y0 != y1:
                inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
        return inside

    @property
    def sides(self) -> Floats:
        """The first and the last corner of every side, (n, 2, 2), counter-clockwise, mm."""
        corners = np.array(self.corners)
        return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)

    @property
    def pieces(self) -> tuple[Line, ...]:
        """The sides as lines, counter-clockwise."""
        return tuple(map(Line, self.corners, (*self.corners[1:], self.corners[0])))


def _corners(values: object) -> Floats:
    """Return corners as (n, 2) float; raise ValueError for anything else."""
    wanted = f"a polygon must have 3 to {MOST_CORNERS} corners (x, y) of finite numbers up to {FARTHEST:g} mm"
    try:
        rows = floats(values)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise ValueError(f"{wanted}, got {str(values)[:60]}") from None
    if rows.ndim != 2 or rows.shape[1] != 2 or not 3 <= len(rows) <= MOST_CORNERS:
        raise ValueError(f"{wanted}, got an array of shape {rows.shape}")
    within = (abs(rows) <= FARTHEST).all(axis=1)
    if not within.all():
        raise ValueError(f"{wanted}, got {rows[~within][0].tolist()}")
    return rows


def _shoelace(corners: Floats) -> float:
    """Return the area within corners, negative where they run clockwise."""
    x, y = (corners - corners[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _require_simple(corners: Floats) -> None:
    """Raise ValueError unless every corner lies at least 1e-6 mm from all sides that do not end there, and no
    sides cross."""
    count = len(corners)
    starts, steps = corners, np.roll(corners, -1, axis=0) - corners
    short = np.flatnonzero(np.hypot(*steps.T) < LEAST_SIZE)
    if len(short):
        k = int(short[0])
        raise ValueError(f"corners {k + 1} and {(k + 1) % count + 1} of the polygon must lie apart")
    along = np.einsum("ijk,jk->ij", corners[:, None] - starts, steps) / (steps**2).sum(axis=1)
    feet = starts + np.clip(along, 0, 1)[..., None] * steps
    apart = np.linalg.norm(corners[:, None] - feet, axis=2)
    index = np.arange(count)
    apart[index, index] = apart[(index + 1) % count, index] = np.inf
    crossed = np.argwhere((apart < LEAST_SIZE) | _crossing(starts, steps))
    if len(crossed):
        first, second = (int(k) for k in crossed[0])
        raise ValueError(
            f"the polygon must not touch or cross itself, but its sides from corner {first + 1} and from "
            f"corner {second + 1} do"
        )


def _crossing(starts: Floats, steps: Floats) -> Bools:
    """Return which pairs of sides have their ends on both sides of each other, (n, n)."""
    to_start = starts[:, None] - starts
    before = _cross(steps, to_start)
    after = _cross(steps, to_start + steps[:, None])
    apart: Bools = before * after < 0
    return apart & apart.T


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
