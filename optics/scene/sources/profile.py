"""How light spreads over the area of a source."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import erf, pi, sqrt

import numpy as np
from scipy.sparse import csr_array
from scipy.special import erf as error_function

from optics.scene.sources.disk_shares import DiskLight
from thbcad.checks import Floats


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
    def _disk(self) -> DiskLight:
        return DiskLight(None if self.kind == "round" else self.sigma)

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
