"""Collimated beams as grids of parallel rays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import erf, pi, sqrt

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Profile:
    """How light spreads over the rectangle of a source: density relative to its mean.

    kind : "uniform"; "round", uniform over the inscribed ellipse; "gaussian", cut off at the rectangle;
        "image"
    sigma : of the Gaussian, relative to half_width
    light : of the image, (rows, columns) linear, row 0 at +y; constant on every pixel
    """

    kind: str = "uniform"
    sigma: tuple[float, float] = (0.5, 0.5)
    light: NDArray[np.float64] | None = None

    def __call__(self, s: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the density at positions relative to half_width, in [-1, 1]; s and t are broadcast."""
        if self.kind == "round":
            return np.where(s**2 + t**2 < 1, 4 / pi, 0.0)
        if self.kind == "gaussian":
            by_s, by_t = (np.exp(-0.5 * (r / w) ** 2) / _mean_gaussian(w) for r, w in zip((s, t), self.sigma))
            return by_s * by_t
        if self.kind == "image":
            rows, columns = self.light.shape
            column = np.minimum(((s + 1) / 2 * columns).astype(np.int64), columns - 1)
            row = np.minimum(((1 - t) / 2 * rows).astype(np.int64), rows - 1)
            return self.light[row, column] / self.light.mean()
        return np.ones(np.broadcast_shapes(s.shape, t.shape))


def _mean_gaussian(sigma: float) -> float:
    """Return the mean of exp(-r^2 / (2 sigma^2)) over [-1, 1]."""
    return sqrt(pi / 2) * sigma * erf(1 / (sigma * sqrt(2)))


@dataclass(frozen=True, eq=False)
class Beam:
    """Rays along +z at the grid x x y (midpoint rule).

    x : (nx,), y : (ny,) float, mm.  ray_flux : W, (nx, ny) float, or one number for all rays.
    missed : W that passes beside the lens.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    ray_flux: float | NDArray[np.float64]
    missed: float

    @property
    def entering(self) -> float:
        """Flux of all rays, W."""
        return float(np.broadcast_to(self.ray_flux, (len(self.x), len(self.y))).sum())

    def slices(self, most: int) -> Iterator[Beam]:
        """Yield beams of at most `most` rays that make up this one."""
        step = max(1, most // len(self.y))
        for start in range(0, len(self.x), step):
            chosen = slice(start, start + step)
            flux = self.ray_flux if np.isscalar(self.ray_flux) else self.ray_flux[chosen]
            yield Beam(self.x[chosen], self.y, flux, 0.0 if start else self.missed)


def collimated_beam(
    half_width: tuple[float, float],
    flux: float,
    aperture: tuple[float, float],
    rays: Sequence[int],
    shift: Sequence[float] | NDArray[np.float64] = (0.0, 0.0),
    profile: Profile = Profile(),
) -> Beam:
    """Return the part of a rectangular beam that meets an aperture.

    half_width : of the source.  aperture : half-widths of the lens.  rays : (nx, ny).
    shift : moves the grid by a fraction of its step, |shift| <= 1/2.
    """
    reach = [min(s, a) for s, a in zip(half_width, aperture)]
    share = reach[0] * reach[1] / (half_width[0] * half_width[1])
    x, y = (-r + (np.arange(n) + 0.5 + s) * (2 * r / n) for r, n, s in zip(reach, rays, shift))
    each = flux * share / (rays[0] * rays[1])
    if profile.kind == "uniform":
        return Beam(x, y, each, flux * (1 - share))
    carried = each * profile(x[:, None] / half_width[0], y[None, :] / half_width[1])
    # the midpoint rule's error is no light that misses
    carried *= flux / carried.sum() if share == 1 else min(1.0, flux / carried.sum())
    return Beam(x, y, carried, max(0.0, flux - carried.sum()))
