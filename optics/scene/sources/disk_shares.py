"""The light within the unit disk, in cells of a rectangle: uniform, or a Gaussian that the disk cuts off.

The density is g_s(s) g_t(t) within s^2 + t^2 < 1.  With the antiderivatives G_s and G_t from 0, the light of
the disk's part between the axes and (s, t) is, in the quadrant s, t >= 0,

    G_s(s) G_t(t)                      where (s, t) lies in the disk, and otherwise
    G_s(a) G_t(t) + H(s) - H(a)        with a = sqrt(1 - t^2), where the arc has the height t.

H(s) is the integral of g_s(u) G_t(sqrt(1 - u^2)) from 0 to s, the light below the arc.  It needs one number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import ceil, pi, sqrt

import numpy as np
from scipy.special import erf

from thbcad.checks import Floats

NODES = 16  # of Gauss's rule in a panel: exact to rounding where a panel is no wider than a sigma
LEAST_PANELS = 16  # of the quarter circle


@dataclass(frozen=True)
class DiskLight:
    """The light of the unit disk.  sigma : of the Gaussian in s and t; None is uniform light."""

    sigma: tuple[float, float] | None = None

    @cached_property
    def mean(self) -> float:
        """The mean over the square around the disk, in units of the density in the middle."""
        return float(self._below(np.ones(1))[0])

    def shares(self, s: Floats, t: Floats) -> Floats:
        """Return the fractions of the light in cells with borders s and t, (len(s) - 1, len(t) - 1).

        s, t : ascending in [-1, 1].
        """
        u, v = np.minimum(np.abs(s), 1), np.minimum(np.abs(t), 1)
        a = np.sqrt(1 - v * v)
        across, up = self._within(0), self._within(1)
        inside = across(u)[:, None] * up(v)
        beyond = across(a) * up(v) + self._below(u)[:, None] - self._below(a)
        # between the axes and (s, t), with the sign of s t
        light = np.sign(s)[:, None] * np.sign(t) * np.where(u[:, None] <= a, inside, beyond)
        within = np.maximum(np.diff(np.diff(light, axis=0), axis=1), 0) / (4 * self.mean)
        return np.where(np.add.outer(_nearest(s), _nearest(t)) < 1, within, 0)  # no roundings beside the disk

    def _within(self, axis: int) -> Callable[[Floats], Floats]:
        """Return the antiderivative G from 0 along an axis."""
        if self.sigma is None:
            return lambda r: r
        sigma = self.sigma[axis]
        return lambda r: sqrt(pi / 2) * sigma * erf(r / (sqrt(2) * sigma))

    def _below(self, s: Floats) -> Floats:
        """Return H at positions in [0, 1]: Gauss's rule in the angle arcsin(s), where the arc is smooth."""
        if self.sigma is None:
            return (s * np.sqrt(1 - s * s) + np.arcsin(s)) / 2
        panels = max(LEAST_PANELS, ceil(pi / 2 / min(self.sigma)))
        grid = np.linspace(0, pi / 2, panels + 1)
        ends, order = np.unique(np.concatenate([grid, np.arcsin(s)]), return_inverse=True)
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        half = np.diff(ends)[:, None] / 2
        angle = ends[:-1, None] + half * (1 + nodes)
        u, v = np.sin(angle), np.cos(angle)
        light = np.exp(-0.5 * (u / self.sigma[0]) ** 2) * self._within(1)(v) * v
        below = np.concatenate([[0.0], np.cumsum((half * weights * light).sum(axis=1))])
        return below[order.ravel()[panels + 1 :]]


def _nearest(borders: Floats) -> Floats:
    """Return the least squares of coordinates within intervals, (len(borders) - 1,)."""
    low, high = borders[:-1], borders[1:]
    return np.maximum(np.maximum(low, -high), 0) ** 2
