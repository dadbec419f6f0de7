"""Zones of a target, in which a standard asks for light: their places, and the light there as pixels tell it.

Places are (H, V).  In the far field they are angles of a goniometer with a vertical polar axis, as standards
of headlamps have them: H = atan(p / r) and V = asin(q) of a direction (p, q, r).  Its chart has u = H and
v = atan(q / r) = atan(tan V / cos H).  On other receivers they are u and v, mm.

Source: the goniometer of UN Regulation No. 112, whose horizontal axis is fixed to the ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, inf, isinf
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from optics.scene.receivers.screen import Screen
from thbcad.checks import Bools, Floats

STEP = 0.5  # pixels between places along a line
MOST_MARGIN = 0.9  # of a limit from above alone, below which light is to stay


def chart_of_goniometer(h: ArrayLike, v: ArrayLike) -> Floats:
    """Return (u, v) of the far field, degrees, (2, ...).  h, v : degrees."""
    h, v = np.broadcast_arrays(np.asarray(h, dtype=np.float64), v)
    return np.array([h, np.degrees(np.arctan(np.tan(np.radians(v)) / np.cos(np.radians(h))))])


def goniometer_of_chart(u: ArrayLike, v: ArrayLike) -> Floats:
    """Return (H, V), degrees, (2, ...).  u, v : of the far field, degrees."""
    u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), v)
    return np.array([u, np.degrees(np.arctan(np.tan(np.radians(v)) * np.cos(np.radians(u))))])


class ZoneReading(NamedTuple):
    """What a row of a table says of light.

    value, error : as a standard deviation.  least, greatest : its limits; 0 and inf are none.
    """

    value: float
    error: float
    least: float
    greatest: float

    @property
    def at_least(self) -> bool:
        """Whether the nearer limit is the lower one."""
        if isinf(self.greatest):
            return True
        return bool(self.least) and self.value / self.least - 1 <= 1 - self.value / self.greatest

    @property
    def limit(self) -> float:
        """The nearer limit, relative to their sizes."""
        return self.least if self.at_least else self.greatest

    @property
    def margin(self) -> float:
        """By how much the nearer limit is kept, relative to it; below 0 where it is missed."""
        over = self.value / self.limit - 1 if self.limit else -1.0  # a part of the peak of no light
        return over if self.at_least else -over


@dataclass(frozen=True, eq=False)
class ZoneRow:
    """A row of a table: places, and the limits of the light there.

    readings : (places, pixels) to be multiplied with light, (rows x columns,).
    least, greatest : of that light; least_of_peak : least, of the greatest on the target.
    brightest : the light is that of the brightest place, else of the darkest.
    margin : that a design aims at.  correction : factor on the limits that it aims at.
    """

    name: str
    readings: csr_array
    least: float
    greatest: float
    least_of_peak: float
    brightest: bool
    margin: float
    correction: float = 1.0

    def aims(self, light: Floats) -> tuple[float, float]:
        """Return the limits that a design aims at: within those of the row by its margin, or in the middle.

        Of the greatest light on the target, no more than half of what lies above the share is aimed at.
        """
        middle = (self.greatest - self.least) / (self.greatest + self.least) if self.least else MOST_MARGIN
        margin = min(self.margin, middle) if self.greatest < inf else self.margin
        share = min(self.least_of_peak * (1 + self.margin), (1 + self.least_of_peak) / 2)
        of_peak = share * float(light.max()) if self.least_of_peak else 0.0
        least, greatest = max(self.least * (1 + margin), of_peak), self.greatest * (1 - margin)
        return self.correction * least, self.correction * greatest

    def reading(self, light: Floats, error: Floats) -> ZoneReading:
        """Return what the row says.  light : (rows, columns); error : of its pixels, a standard deviation."""
        values = self.readings @ light.ravel()
        k = int(np.argmax(values) if self.brightest else np.argmin(values))
        weights = self.readings[[k]]
        noise = float(np.sqrt((weights.multiply(weights) @ np.square(error.ravel()))[0]))
        least = max(self.least, self.least_of_peak * float(light.max()))
        return ZoneReading(float(values[k]), noise, least, self.greatest)


def zone_places(shape: str, corners: ArrayLike, screen: Screen, right: int = 1) -> Floats:
    """Return (u, v) of all places of a zone at which its light is read, (n, 2).

    Those of a line are half a pixel apart; a box or polygon has its border and the pixels within.

    shape : points, box (two opposite corners), line, polygon or whole.  corners : (n, 2) of (H, V).
    right : -1 where H counts to -u.
    """
    u, v = (axis.ravel() for axis in np.meshgrid(*screen.centres))
    if shape == "whole":
        return np.stack([u, v], axis=1)
    found = np.array(corners, dtype=np.float64).reshape(-1, 2)
    if shape == "box":
        (a, b), (c, d) = found
        found = np.array([[a, b], [c, b], [c, d], [a, d]])
    if shape in ("box", "polygon"):
        h, up = goniometer_of_chart(u, v) if screen.angular else (u, v)
        within = _inside(found, right * h, up)
        border = _along(np.vstack([found, found[:1]]), STEP * min(screen.pitch))
        found = np.vstack([border, np.stack([right * h, up], axis=1)[within]])
    elif shape == "line":
        found = _along(found, STEP * min(screen.pitch))
    h, up = found.T
    return np.asarray(chart_of_goniometer(right * h, up) if screen.angular else (right * h, up)).T


def zone_readings(places: Floats, screen: Screen) -> csr_array:
    """Return the matrix that reads light at places from pixels, linear between their centres, (n, pixels).

    places : (n, 2) of (u, v) on the screen; beside the outermost centres their light counts.
    """
    (columns, rows), (px, py), (hx, hy) = screen.pixels, screen.pitch, screen.half_width
    column = np.clip((places[:, 0] + hx) / px - 0.5, 0, columns - 1)
    row = np.clip((hy - places[:, 1]) / py - 0.5, 0, rows - 1)
    left = np.minimum(column.astype(np.int64), columns - 2)
    top = np.minimum(row.astype(np.int64), rows - 2)
    a, b = column - left, row - top
    parts = [((1 - a) * (1 - b), 0, 0), (a * (1 - b), 1, 0), ((1 - a) * b, 0, 1), (a * b, 1, 1)]
    weights = np.concatenate([weight for weight, _, _ in parts])
    pixels = np.concatenate([(top + down) * columns + left + across for _, across, down in parts])
    number = np.tile(np.arange(len(places)), len(parts))
    return csr_array((weights, (number, pixels)), shape=(len(places), columns * rows))


def zone_rows(
    name: str,
    places: Floats,
    screen: Screen,
    limits: tuple[float, float, float],
    margin: float,
    peak: bool = False,
) -> list[ZoneRow]:
    """Return the rows of a region: the lower limits of its darkest place, the upper one of its brightest.

    limits : least, greatest and least_of_peak.  peak : all are limits of its brightest place.
    """
    readings, (least, greatest, of_peak) = zone_readings(places, screen), limits
    if peak or len(places) == 1:
        return [ZoneRow(name, readings, least, greatest, of_peak, peak, margin)]
    rows = []
    if least or of_peak:
        rows.append(ZoneRow(f"{name}, darkest", readings, least, inf, of_peak, False, margin))
    if greatest < inf:
        rows.append(ZoneRow(f"{name}, brightest", readings, 0.0, greatest, 0.0, True, margin))
    return rows


def _along(corners: Floats, step: float) -> Floats:
    """Return places from corner to corner, at most a step apart, (n, 2)."""
    parts = []
    for start, end in pairwise(corners):
        count = max(1, ceil(float(np.linalg.norm(end - start)) / step))
        parts.append(start + (end - start) * np.arange(count)[:, None] / count)
    return np.vstack([*parts, corners[-1:]])


def _inside(corners: Floats, x: Floats, y: Floats) -> Bools:
    """Return which points lie in a polygon: rays from them to -x cross it an odd number of times."""
    odd = np.zeros(x.shape, dtype=bool)
    for (a, b), (c, d) in zip(corners, np.roll(corners, -1, axis=0)):
        crosses = (b > y) != (d > y)
        odd ^= crosses & (x > a + (y - b) * (c - a) / (d - b or 1.0))
    return odd
