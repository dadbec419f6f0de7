"""Collimated beams as grids of parallel rays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from optics.scene.sources.profile import UNIFORM, Profile
from optics.scene.sources.rays import RayGrid
from thbcad.checks import Floats


def collimated_beam(
    half_width: Sequence[float],
    flux: float,
    aperture: Sequence[float],
    rays: Sequence[int],
    shift: Sequence[float] | Floats = (0.0, 0.0),
    profile: Profile = UNIFORM,
    centre: Sequence[float] = (0.0, 0.0),
) -> RayGrid:
    """Return the part of a rectangular beam that meets an aperture.

    half_width : of the source.  aperture, centre : as of `lit_part`.  rays : (nx, ny).
    shift : moves the grid by a fraction of its step, |shift| <= 1/2.
    """
    middles, lit = lit_part(half_width, aperture, centre)
    fraction = lit[0] * lit[1] / (half_width[0] * half_width[1])
    x, y = (m - h + (np.arange(n) + 0.5 + s) * (2 * h / n) for m, h, n, s in zip(middles, lit, rays, shift))
    each = flux * fraction / (rays[0] * rays[1])
    if profile.kind == "uniform":
        return RayGrid(x, y, np.broadcast_to(each, (len(x), len(y))), flux * (1 - fraction))
    if profile.kind == "image":  # pixels may be narrower than the rays are apart
        borders = (_borders(r, m, h) / w for r, m, h, w in zip((x, y), middles, lit, half_width))
        carried = flux * profile.shares(*borders)
        return RayGrid(x, y, carried, max(0.0, flux - carried.sum()))
    carried = each * profile(x[:, None] / half_width[0], y[None, :] / half_width[1])
    # the midpoint rule's error is no light that misses
    carried *= flux / carried.sum() if fraction == 1 else min(1.0, flux / carried.sum())
    return RayGrid(x, y, carried, max(0.0, flux - carried.sum()))


def lit_part(
    half_width: Sequence[float], aperture: Sequence[float], centre: Sequence[float]
) -> tuple[list[float], list[float]]:
    """Return middle and half-widths of the part of a beam that meets an aperture; of all, where none does.

    half_width : of the beam.  aperture, centre : half-widths of the lens, and its middle in the beam.
    """
    middles, halves = [], []
    for beam, half, c in zip(half_width, aperture, centre):
        low, high = max(-beam, c - half), min(beam, c + half)
        if low >= high:
            low, high = -beam, beam
        middles.append((low + high) / 2)
        halves.append((high - low) / 2)
    return middles, halves


def _borders(row: Floats, middle: float, half: float) -> Floats:
    """Return the borders of the cells of rays in a row, which tile |x - middle| <= half."""
    return np.concatenate([[middle - half], (row[1:] + row[:-1]) / 2, [middle + half]])
