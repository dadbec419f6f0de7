"""A straight road with like lamps at equal distances, and the points of it that EN 13201-3 asks for.

x runs along the road in the direction of travel, y to the left from its right edge, z up; metres.  A lamp
of the right row has its C0 along +x and C90 towards the road, along +y; the left row is that, turned by
180 degrees.  The tilt lifts C90.  The field lies between two lamps of a row, from x = 0 to the spacing S.
Its n columns and the rows of a strip of width w lie at

    x = (k + 1/2) S / n,  n = 10 for S <= 30 m, else the least n with S / n <= 3 m,
    y = (k + 1/2) w / m,  m = 3 in a lane for luminance, else the least m >= 3 with w / m <= 1.5 m.

Source: EN 13201-3:2015, Road lighting, Part 3: Calculation of performance.  `road_classes` says what was
compared with what.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from optics.base.runtime import UserError
from thbcad.checks import Floats

RANGES: dict[str, tuple[float, float, str]] = {
    "height": (2, 100, " m"),  # above the eye, too
    "spacing": (1, 1000, " m"),
    "lanes": (1, 20, ""),
    "lane_width": (0.5, 50, " m"),
    "overhang": (-50, 50, " m"),
    "tilt": (-90, 90, " degrees"),
    "maintenance": (0.01, 1, ""),
    "lenses": (1, 10_000, ""),
}
ROWS: dict[str, tuple[tuple[int, float], ...]] = {  # (1 right or -1 left, by how many spacings on)
    "right": ((1, 0.0),),
    "left": ((-1, 0.0),),
    "opposite": ((1, 0.0), (-1, 0.0)),
    "staggered": ((1, 0.0), (-1, 0.5)),
}
SHORT, COLUMNS, APART = 30.0, 10, 3.0  # m: a field with so many columns, and what they may be apart in others
ACROSS, LEAST_ACROSS = 1.5, 3  # m between rows at most; rows of a strip at least
ROUNDING = 1e-9  # of a count


@dataclass(frozen=True)
class Installation:
    """Lamps along a road of like lanes.

    height, spacing : m, of the lamps, and between those of one row.
    lanes, lane_width : all are driven in +x; m.
    overhang : m, of the lamps over the edge of the road; negative beside it.
    tilt : degrees, by which the light is lifted towards the road.
    rows : a name of ROWS.
    maintenance : what is left of the initial light.
    lenses : like ones in every lamp.

    Raises UserError : a number out of its range.
    """

    height: float
    spacing: float
    lanes: int = 2
    lane_width: float = 3.5
    overhang: float = 0.0
    tilt: float = 0.0
    rows: str = "right"
    maintenance: float = 0.8
    lenses: int = 1

    def __post_init__(self) -> None:
        for name, (low, high, unit) in RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                word = name.replace("_", "-")
                raise UserError(f"--{word} must be from {low:g} to {high:g}{unit}, got {value:g}{unit}")

    @property
    def width(self) -> float:
        """Of all lanes, m."""
        return self.lanes * self.lane_width

    @property
    def columns(self) -> Floats:
        """The x of the points of the field, m."""
        count = COLUMNS if self.spacing <= SHORT else ceil(self.spacing / APART - ROUNDING)
        return _middles(0.0, self.spacing, count)

    @property
    def lane_middles(self) -> Floats:
        """The y of the middles of the lanes, m."""
        return _middles(0.0, self.width, self.lanes)

    def strip(self, low: float, high: float) -> Floats:
        """Return the points for the illuminance of the strip between two y, (2, n) m."""
        count = max(LEAST_ACROSS, ceil((high - low) / ACROSS - ROUNDING))
        return self._points(_middles(low, high, count))

    @property
    def lane_points(self) -> Floats:
        """The points for the luminance, (2, n) m: three across each lane, one of these in its middle."""
        return self._points(_middles(0.0, self.width, 3 * self.lanes))

    def _points(self, y: Floats) -> Floats:
        """Return a row of points along the field at each y, one row after the other, (2, n)."""
        return np.stack([np.tile(self.columns, len(y)), np.repeat(y, len(self.columns))])

    def lamps(self, low: float, high: float) -> Floats:
        """Return x, y and side (1 right, -1 left) of the lamps with low <= x <= high, (3, m)."""
        found = []
        for side, shift in ROWS[self.rows]:
            start, stop = low / self.spacing - shift, high / self.spacing - shift
            numbers = np.arange(ceil(start), np.floor(stop) + 1)
            y = self.overhang if side > 0 else self.width - self.overhang
            found += [[(k + shift) * self.spacing, y, side] for k in numbers]
        return np.array(found, dtype=np.float64).reshape(-1, 3).T


def _middles(low: float, high: float, count: int) -> Floats:
    """Return the middles of like parts, (count,)."""
    return low + np.arange(0.5, count) * ((high - low) / count)
