"""How light spreads over the area of a source."""

from __future__ import annotations

from dataclasses import dataclass
from math import erf, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.special import erf as error_function


@dataclass(frozen=True, eq=False)
class Profile:
    """How light spreads over the rectangle of a source: density relative to its mean.

    kind : "uniform"; "round", uniform over the inscribed ellipse; "gaussian", cut off at the rectangle;
        "image".
    sigma : of the Gaussian, relative to half_width.
    light : of the image, (rows, columns) linear, row 0 at +y; constant on every pixel.

    Raises
    ------
    ValueError : the kind "image" without light.
    """

    kind: str = "uniform"
    sigma: tuple[float, float] = (0.5, 0.5)
    light: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if self.kind == "image" and self.light is None:
            raise ValueError('the profile "image" needs light, got None')

    def __call__(self, s: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the density at positions relative to half_width, in [-1, 1]; s and t are broadcast."""
        if self.kind == "round":
            return np.where(s**2 + t**2 < 1, 4 / pi, 0.0)
        if self.kind == "gaussian":
            by_s, by_t = (np.exp(-0.5 * (r / w) ** 2) / _mean_gaussian(w) for r, w in zip((s, t), self.sigma))
            return by_s * by_t
        if self.kind == "image" and self.light is not None:
            rows, columns = self.light.shape
            column = np.minimum(((s + 1) / 2 * columns).astype(np.int64), columns - 1)
            row = np.minimum(((1 - t) / 2 * rows).astype(np.int64), rows - 1)
            return self.light[row, column] / self.light.mean()
        return np.ones(np.broadcast_shapes(s.shape, t.shape))

    def shares(self, s: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the exact fractions of the light in cells with borders s and t, (len(s) - 1, len(t) - 1).

        s, t : relative to half_width, ascending in [-1, 1].
        """
        if self.kind == "round":
            areas = np.diff(np.diff(_disk_area(s[:, None], t[None, :]), axis=0), axis=1)
            return np.maximum(areas, 0) / pi
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


def _mean_gaussian(sigma: float) -> float:
    """Return the mean of exp(-r^2 / (2 sigma^2)) over [-1, 1]."""
    return sqrt(pi / 2) * sigma * erf(1 / (sigma * sqrt(2)))


def _overlaps(borders: NDArray[np.float64], pixels: int) -> csr_array:
    """Return the fractions of pixels that tile [-1, 1] within intervals, (len(borders) - 1, pixels)."""
    position = np.clip((borders + 1) / 2 * pixels, 0, pixels)
    return csr_array(np.diff(np.clip(position[:, None] - np.arange(pixels), 0, 1), axis=0))


def _disk_area(s: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the area of the unit disk's part between the axes and (s, t), with the sign of s t.

    Of the quadrant s, t >= 0 it is s t where (s, t) lies in the disk, and otherwise, with
    G(u) = (u sqrt(1 - u^2) + arcsin(u)) / 2 the area below the arc from 0 to u, and a = sqrt(1 - t^2) where
    the arc has the height t,

        a t + G(s) - G(a).
    """
    u, v = np.broadcast_arrays(np.minimum(np.abs(s), 1), np.minimum(np.abs(t), 1))

    def below(r: NDArray[np.float64]) -> NDArray[np.float64]:
        return (r * np.sqrt(1 - r * r) + np.arcsin(r)) / 2

    height = np.sqrt(1 - v * v)
    area = np.where(u <= height, u * v, height * v + below(u) - below(height))
    return np.sign(s) * np.sign(t) * area


UNIFORM = Profile()
