"""Zones of a target, in which a standard asks for light: their places, and the light there as pixels tell it.

Places are (H, V).  In the far field they are angles of a goniometer with a vertical polar axis, as standards
of headlamps have them: H = atan(p / r) and V = asin(q) of a direction (p, q, r).  Its chart has u = H and
v = atan(q / r) = atan(tan V / cos H).  On other receivers they are u and v, mm.

The light at a place is its mean over a square around it, the aperture of a photometer, or over a pixel where
that is larger.

Source: the goniometer of UN Regulation No. 112, whose horizontal axis is fixed to the ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, hypot, inf, isinf
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from optics.base.statistics import crossed_choice, crossed_error, drift_error, drift_signs
from optics.scene.receivers.screen import Screen
from thbcad.checks import Bools, Floats, Integers

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
    peaks : readings all over the target, where `least_of_peak` asks for them.
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
    peaks: csr_array | None = None
    correction: float = 1.0

    def aims(self, light: Floats) -> tuple[float, float]:
        """Return the limits that a design aims at: within those of the row by its margin, or in the middle.

        Of the greatest light on the target, no more than half of what lies above the share is aimed at.
        """
        margin, greatest = self.margin, self.greatest
        if greatest < inf:  # else the margin may be 1 or more
            middle = (greatest - self.least) / (greatest + self.least) if self.least else MOST_MARGIN
            margin = min(margin, middle)
            greatest *= 1 - margin
        share = min(self.least_of_peak * (1 + self.margin), (1 + self.least_of_peak) / 2)
        of_peak = 0.0 if self.peaks is None else share * float((self.peaks @ light.ravel()).max())
        least = max(self.least * (1 + margin), of_peak)
        return self.correction * least, self.correction * greatest

    def reading(self, draws: Floats, drift: Floats | float = 0.0) -> ZoneReading:
        """Return what the row says.

        draws : (R, rows, columns), independent measurements of the light.
        drift : (rows, columns), an error that they have in common, of known size about.
        """
        every = draws.reshape(len(draws), -1)
        values, chosen = _chosen(self.readings, every, self.brightest)
        weights, value, least = self.readings[chosen[:1]], float(values.mean()), self.least
        if self.peaks is not None:
            peaks, brightest = _chosen(self.peaks, every, True)
            if self.least_of_peak * float(peaks.mean()) > least:  # the limit errs, too
                least = self.least_of_peak * float(peaks.mean())
                values = values - self.least_of_peak * peaks
                weights = weights - self.least_of_peak * self.peaks[brightest[:1]]
        signs = drift_signs(draws.shape[1:])
        drifts = [float((weights @ np.broadcast_to(s * drift, draws.shape[1:]).ravel())[0]) for s in signs]
        error = hypot(crossed_error(values, chosen), drift_error(0.0, drifts))
        if len(draws) == 1:  # pixels twice as wide change one to three times what these leave
            wider = [float((weights @ (draws[0] - _in_pairs(draws[0], axis)).ravel())[0]) for axis in (0, 1)]
            error = hypot(error, *(change / 2 for change in wider))
        return ZoneReading(value, error, least, self.greatest)


def _in_pairs(light: Floats, axis: int) -> Floats:
    """Return light on its pixels, (rows, columns), as means over two in one direction show it."""
    count = light.shape[axis]
    first = np.minimum(np.arange(count) // 2 * 2, max(count - 2, 0))
    return np.asarray((light.take(first, axis) + light.take(np.minimum(first + 1, count - 1), axis)) / 2)


def _chosen(readings: csr_array, draws: Floats, brightest: bool) -> tuple[Floats, Integers]:
    """Return every replicate's light at the brightest or darkest place, (R,), and the places' numbers."""
    found = (readings @ draws.T).T
    chosen = crossed_choice(found, np.argmax if brightest else np.argmin)
    return found[np.arange(len(found)), chosen], chosen


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


def zone_readings(places: Floats, screen: Screen, aperture: float = 0.0) -> csr_array:
    """Return the matrix that reads light at places from pixels, (n, pixels): means over squares around them.

    Light is taken as even within a pixel; over squares as wide as pixels that is linear between centres.

    places : (n, 2) of (u, v) on the screen; beside it the light of the nearest square on it counts.
    aperture : width of the squares, mm or degrees; at least a pixel.
    """
    (columns, rows), (u, v) = screen.pixels, places.T
    across, left = _shares(u, columns, screen.half_width[0], aperture)
    down, top = _shares(-v, rows, screen.half_width[1], aperture)
    weights = down[:, :, None] * across[:, None, :]
    pixels = (top[:, None] + np.arange(down.shape[1]))[:, :, None] * columns
    pixels = pixels + (left[:, None] + np.arange(across.shape[1]))[:, None, :]
    first = np.arange(len(places) + 1) * (down.shape[1] * across.shape[1])
    return csr_array((weights.ravel(), pixels.ravel(), first), shape=(len(places), columns * rows))


def _shares(at: Floats, count: int, half_width: float, aperture: float) -> tuple[Floats, Integers]:
    """Return the shares of intervals around places in neighbouring pixels of a row, and the first of these.

    Returns (places, pixels) and (places,).
    """
    pitch = 2 * half_width / count
    width = min(max(aperture / pitch, 1.0), count)  # pixels
    low = np.clip((at + half_width) / pitch - width / 2, 0, count - width)
    number = min(ceil(width) + 1, count)
    first = np.minimum(low.astype(np.int64), count - number)
    left = first[:, None] + np.arange(number)
    ends = np.minimum(left + 1, (low + width)[:, None]), np.maximum(left, low[:, None])
    return np.maximum(ends[0] - ends[1], 0.0) / width, first


def zone_rows(
    name: str,
    places: Floats,
    screen: Screen,
    limits: tuple[float, float, float],
    margin: float,
    peak: bool = False,
    aperture: float = 0.0,
) -> list[ZoneRow]:
    """Return the rows of a region: the lower limits of its darkest place, the upper one of its brightest.

    limits : least, greatest and least_of_peak.  peak : all are limits of its brightest place.
    aperture : as of `zone_readings`.
    """
    readings, (least, greatest, of_peak) = zone_readings(places, screen, aperture), limits
    everywhere = zone_readings(zone_places("whole", (), screen), screen, aperture) if of_peak else None
    if peak or len(places) == 1:
        return [ZoneRow(name, readings, least, greatest, of_peak, peak, margin, everywhere)]
    rows = []
    if least or of_peak:
        rows.append(ZoneRow(f"{name}, darkest", readings, least, inf, of_peak, False, margin, everywhere))
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
