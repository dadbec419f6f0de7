"""Collimated beams as grids of parallel rays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Beam:
    """Rays along +z at the grid x x y, each with the same flux (midpoint rule).

    x : (nx,), y : (ny,) float, mm.  ray_flux : W.  missed : W that passes beside the lens.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    ray_flux: float
    missed: float

    def slices(self, most: int) -> Iterator[Beam]:
        """Yield beams of at most `most` rays that make up this one."""
        step = max(1, most // len(self.y))
        for start in range(0, len(self.x), step):
            yield Beam(self.x[start : start + step], self.y, self.ray_flux, 0.0 if start else self.missed)


def collimated_beam(
    half_width: tuple[float, float],
    flux: float,
    aperture: tuple[float, float],
    rays: Sequence[int],
    shift: Sequence[float] | NDArray[np.float64] = (0.0, 0.0),
) -> Beam:
    """Return the part of a uniform square beam that meets an aperture.

    half_width : of the source.  aperture : half-widths of the lens.  rays : (nx, ny).
    shift : moves the grid by a fraction of its step, |shift| <= 1/2.
    """
    reach = [min(s, a) for s, a in zip(half_width, aperture)]
    share = reach[0] * reach[1] / (half_width[0] * half_width[1])
    x, y = (-r + (np.arange(n) + 0.5 + s) * (2 * r / n) for r, n, s in zip(reach, rays, shift))
    return Beam(x, y, flux * share / (rays[0] * rays[1]), flux * (1 - share))
