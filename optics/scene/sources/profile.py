"""How light spreads over the area of a source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import ceil, erf, pi, sqrt

import numpy as np
from scipy.sparse import csr_array
from scipy.special import erf as error_function

from thbcad.checks import Floats

NODES = 16  # of Gauss's rule in a panel: exact to rounding where a panel is no wider than a sigma
LEAST_PANELS = 16  # of the quarter circle


@dataclass(frozen=True)
class _DiskLight:
    """The light of the unit disk.  sigma : of the Gaussian in s and t; None is uniform light.

    The density is g_s(s) g_t(t) within s^2 + t^2 < 1.  With the antiderivatives G_s and G_t from 0, the light
    of the disk's part between the axes and (s, t) is, in the quadrant s, t >= 0,

        G_s(s) G_t(t)                      where (s, t) lies in the disk, and otherwise
        G_s(a) G_t(t) + H(s) - H(a)        with a = sqrt(1 - t^2), where the arc has the height t.

    H(s) is the integral of g_s(u) G_t(sqrt(1 - u^2)) from 0 to s, the light below the arc.  It needs one
    number.
    """

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
        return lambda r: sqrt(pi / 2) * sigma * error_function(r / (sqrt(2) * sigma))

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


@dataclass(frozen=True, eq=False)
class Profile:
    """How light spreads over the rectangle of a source: density relative to its mean.

    kind : "uniform"; "round", uniform over the inscribed ellipse; "gaussian", cut off at the rectangle;
        "round_gaussian", cut off at the ellipse; "image".
    sigma : of the Gaussians, relative to half_width.
    light : of the image, (rows, columns) linear, row 0 at +y; constant on every pixel.

    Raises ValueError : the kind "image" without light.
    """

    kind: str = "uniform"
    sigma: tuple[float, float] = (0.5, 0.5)
    light: Floats | None = None

    def __post_init__(self) -> None:
        if self.kind == "image" and self.light is None:
            raise ValueError('the profile "image" needs light, got None')

    @property
    def round(self) -> bool:
        """Whether the light fills the inscribed ellipse only."""
        return self.kind in ("round", "round_gaussian")

    @cached_property
    def _disk(self) -> _DiskLight:
        return _DiskLight(None if self.kind == "round" else self.sigma)

    @property
    def area(self) -> float:
        """The area that shines, over half_width x half_width."""
        return pi if self.round else 4.0

    def __call__(self, s: Floats, t: Floats) -> Floats:
        """Return the density at positions relative to half_width, in [-1, 1]; s and t are broadcast."""
        if self.kind == "round":
            return np.where(s**2 + t**2 < 1, 4 / pi, 0.0)
        if self.kind == "round_gaussian":
            light = np.exp(-0.5 * ((s / self.sigma[0]) ** 2 + (t / self.sigma[1]) ** 2))
            return np.where(s**2 + t**2 < 1, light, 0.0) / self._disk.mean
        if self.kind == "gaussian":
            # over the mean of exp(-r^2 / (2 sigma^2)) over [-1, 1]
            by_s, by_t = (
                np.exp(-0.5 * (r / w) ** 2) / (sqrt(pi / 2) * w * erf(1 / (w * sqrt(2))))
                for r, w in zip((s, t), self.sigma)
            )
            return by_s * by_t
        if self.kind == "image" and self.light is not None:
            rows, columns = self.light.shape
            column = np.minimum(((s + 1) / 2 * columns).astype(np.int64), columns - 1)
            row = np.minimum(((1 - t) / 2 * rows).astype(np.int64), rows - 1)
            return self.light[row, column] / self.light.mean()
        return np.ones(np.broadcast_shapes(s.shape, t.shape))

    def shares(self, s: Floats, t: Floats) -> Floats:
        """Return the exact fractions of the light in cells with borders s and t, (len(s) - 1, len(t) - 1).

        s, t : relative to half_width, ascending in [-1, 1].
        """
        if self.round:
            return self._disk.shares(s, t)
        if self.kind == "gaussian":
            by_s, by_t = (
                np.diff(error_function(r / (w * sqrt(2)))) / (2 * erf(1 / (w * sqrt(2))))
                for r, w in zip((s, t), self.sigma)
            )
            return np.outer(by_s, by_t)
        if self.kind == "image" and self.light is not None:
            rows, columns = self.light.shape
            by_s, by_t = _overlaps(s, columns), _overlaps(t, rows)
            return by_s @ (self.light[::-1].T / self.light.sum()) @ by_t.T
        return np.outer(np.diff(s), np.diff(t)) / 4


def _overlaps(borders: Floats, pixels: int) -> csr_array:
    """Return the fractions of pixels that tile [-1, 1] within intervals, (len(borders) - 1, pixels)."""
    position = np.clip((borders + 1) / 2 * pixels, 0, pixels)
    return csr_array(np.diff(np.clip(position[:, None] - np.arange(pixels), 0, 1), axis=0))


UNIFORM = Profile()
