"""The region that uniform light is asked for on, its border, and how sharp light falls there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import distance_transform_edt

from thbcad.checks import Bools, Floats

RASTER = 420  # cells in each direction: 21, 20, 15, 14 and 12 boxes have whole numbers of them
HIGH, LOW = 0.9, 0.1  # of the light within: what lies between is the edge


@dataclass(frozen=True, eq=False)
class LitRegion:
    """A region of the target within its bounding rectangle.

    x, y : from and to, mm or degrees.  inside : RASTER x RASTER equal cells of the rectangle that lie wholly
    in the region, (rows, columns), row 0 at +y.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    inside: Bools

    @classmethod
    def of_pixels(cls, lit: Bools, half_width: tuple[float, float]) -> LitRegion | None:
        """Return the region that pixels make up; None where there is none.

        lit : (rows, columns), that tile |x| <= half_width[0], |y| <= half_width[1].
        """
        if not lit.any():
            return None
        rows, columns = (np.flatnonzero(lit.any(axis=axis)) for axis in (1, 0))
        part = lit[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        at = [(np.arange(RASTER) + 0.5) / RASTER * n for n in part.shape]
        high, wide = (2 * half_width[1] / lit.shape[0], 2 * half_width[0] / lit.shape[1])
        return cls(
            (float(columns[0]) * wide - half_width[0], float(columns[-1] + 1) * wide - half_width[0]),
            (half_width[1] - float(rows[-1] + 1) * high, half_width[1] - float(rows[0]) * high),
            part[np.ix_(*(a.astype(int) for a in at))],
        )

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the bounding rectangle."""
        return self.x[1] - self.x[0], self.y[1] - self.y[0]

    @cached_property
    def depth(self) -> Floats:
        """How far the far side of every raster cell is from the border at least, (rows, columns)."""
        step = [length / RASTER for length in self.size[::-1]]
        far: Floats = distance_transform_edt(np.pad(self.inside, 1), sampling=step)[1:-1, 1:-1]
        return far - max(step)


def edge_width(light: Floats, lit: Bools, level: float, pitch: tuple[float, float]) -> float | None:
    """Return the width over which light falls from 90 to 10 % of a level, across the border of lit pixels.

    It is that of the mean light at the same distance from the border, all along it, and no less than 0.8
    pixels.  None where all pixels are lit, or where the light does not fall so far.

    light, lit : (rows, columns).  pitch : of a pixel (x, y), mm or degrees.
    """
    if level <= 0 or lit.all() or not lit.any():
        return None
    sampling, half = pitch[::-1], min(pitch) / 2
    within = distance_transform_edt(lit, sampling=sampling)
    beside = distance_transform_edt(~lit, sampling=sampling)
    distance = np.where(lit, within - half, half - beside)
    step = np.floor(distance / (2 * half)).astype(int)  # a border between two pixels parts two steps
    first = step.min()
    count = np.bincount((step - first).ravel())
    total, places = (np.bincount((step - first).ravel(), a.ravel()) for a in (light, distance))
    known = count > 0
    profile, at = total[known] / count[known] / level, places[known] / count[known]
    low, high = (_first_crossing(at, profile, part) for part in (LOW, HIGH))
    if low is None or high is None:
        return None
    return float(high - low)


def _first_crossing(at: Floats, profile: Floats, part: float) -> float | None:
    """Return where a profile rises to a part, linear between its points; None where it does not."""
    above = np.flatnonzero(profile >= part)
    if not above.size or above[0] == 0:
        return None
    k = above[0]
    share = (part - profile[k - 1]) / (profile[k] - profile[k - 1])
    return float(at[k - 1] + share * (at[k] - at[k - 1]))
