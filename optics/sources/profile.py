"""How light spreads over the area of a source."""

from __future__ import annotations

from dataclasses import dataclass
from math import erf, pi, sqrt

import numpy as np
from numpy.typing import NDArray


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


def _mean_gaussian(sigma: float) -> float:
    """Return the mean of exp(-r^2 / (2 sigma^2)) over [-1, 1]."""
    return sqrt(pi / 2) * sigma * erf(1 / (sigma * sqrt(2)))


UNIFORM = Profile()
