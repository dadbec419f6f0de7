"""Collimated beams as grids of parallel rays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from optics.sources.profile import UNIFORM, Profile
from optics.sources.rays import RayGrid


def collimated_beam(
    half_width: tuple[float, float],
    flux: float,
    aperture: tuple[float, float],
    rays: Sequence[int],
    shift: Sequence[float] | NDArray[np.float64] = (0.0, 0.0),
    profile: Profile = UNIFORM,
) -> RayGrid:
    """Return the part of a rectangular beam that meets an aperture.

    half_width : of the source.  aperture : half-widths of the lens.  rays : (nx, ny).
    shift : moves the grid by a fraction of its step, |shift| <= 1/2.
    """
    lit = [min(s, a) for s, a in zip(half_width, aperture)]  # half-widths of the part
    fraction = lit[0] * lit[1] / (half_width[0] * half_width[1])
    x, y = (-h + (np.arange(n) + 0.5 + s) * (2 * h / n) for h, n, s in zip(lit, rays, shift))
    each = flux * fraction / (rays[0] * rays[1])
    if profile.kind == "uniform":
        return RayGrid(x, y, np.broadcast_to(each, (len(x), len(y))), flux * (1 - fraction))
    if profile.kind == "image":  # pixels may be narrower than the rays are apart
        borders = (_borders(r, h) / w for r, h, w in zip((x, y), lit, half_width))
        carried = flux * profile.shares(*borders)
        return RayGrid(x, y, carried, max(0.0, flux - carried.sum()))
    carried = each * profile(x[:, None] / half_width[0], y[None, :] / half_width[1])
    # the midpoint rule's error is no light that misses
    carried *= flux / carried.sum() if fraction == 1 else min(1.0, flux / carried.sum())
    return RayGrid(x, y, carried, max(0.0, flux - carried.sum()))


def _borders(row: NDArray[np.float64], half: float) -> NDArray[np.float64]:
    """Return the borders of the cells of rays in a row, which tile |x| <= half."""
    return np.concatenate([[-half], (row[1:] + row[:-1]) / 2, [half]])
