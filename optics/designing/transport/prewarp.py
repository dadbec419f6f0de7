"""The density to ask for where light lands beside its place, or is lost, so that the one wanted arrives.

The slopes that would send all light to its place are those of no surface, where light goes far aside.  The
surface with the nearest slopes moves the light that is sent to y on to y + d(y).  This d hardly changes where
light is sent a little elsewhere.  So a map to

    g(y) = T(y + d(y)) det(1 + Dd(y)) / s(y)

brings the density T, where the share s(y) of the light that is sent to y goes on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter

from thbcad.checks import Floats, Integers

CELLS_PER_BIN = 4  # in each direction: d is averaged in bins, since it is smooth but for cracks of the map
CELLS_PER_FINE_BIN = 2
LEAST_SHARE = 0.1  # that is made up for: with less, grazing light would take the light of all else
FEW = 1e-3  # of the mean light of a bin: with less its d is that of the nearest other
SAMPLES = 2  # of a cell in each direction
STRIP = 16  # rows of cells at a time, whose arrays stay in the processor's cache


def prewarped(
    wanted: Floats,
    sent: Sequence[Floats],
    beside: Sequence[Floats],
    light: Floats,
    fine: bool = False,
    share: Floats | None = None,
) -> Floats:
    """Return the density to ask for, (nx, ny), of any scale; T itself where d leads all of it off the target.

    wanted : T, (nx, ny), its cell means over the target.
    sent : two arrays (mx, my), where the light of source cells is sent, the target being [-1, 1]^2.
    beside : two such arrays, d.  light : (mx, my), flux of the source cells.
    fine : d is as uneven as the picture.  share : (mx, my), of the light that goes on; None is all.
    """
    bins = [-(-n // (CELLS_PER_FINE_BIN if fine else CELLS_PER_BIN)) for n in wanted.shape]
    (nx, ny), samples = wanted.shape, [SAMPLES * n for n in wanted.shape]
    in_samples = [d * (n / 2) for d, n in zip(beside, samples)]
    passing = np.ones_like(light) if share is None else share
    values = np.stack(_binned(sent, [*in_samples, passing], light, bins))
    values, across = _linear(values, 2, *_between(bins[1], samples[1]))
    per_sample = [b / n for b, n in zip(bins, samples)]
    low, high, part = _between(bins[0], samples[0])
    columns, asked = np.arange(samples[1]), np.empty(wanted.shape)
    for first in range(0, nx, STRIP):
        rows = np.arange(SAMPLES * first, SAMPLES * min(first + STRIP, nx))
        between = low[rows], high[rows], part[rows]
        (dx, dy, passed), change = _linear(values, 1, *between)
        xx, yx = change[:2] * per_sample[0]
        xy, yy = _linear(across[:2], 1, *between)[0] * per_sample[1]
        row = np.floor(dx + rows[:, None] + 0.5).astype(int) // SAMPLES
        column = np.floor(dy + columns + 0.5).astype(int) // SAMPLES
        on_target = (row >= 0) & (row < nx) & (column >= 0) & (column < ny)
        arriving = on_target * wanted[np.clip(row, 0, nx - 1), np.clip(column, 0, ny - 1)]
        arriving *= np.maximum((1 + xx) * (1 + yy) - xy * yx, 0.0)
        arriving /= np.maximum(passed, LEAST_SHARE)
        asked[first : first + STRIP] = arriving.reshape(-1, SAMPLES, ny, SAMPLES).mean(axis=(1, 3))
    return asked if asked.any() else wanted


def _between(bins: int, samples: int) -> tuple[Integers, Integers, Floats]:
    """Return the two bins between whose middles samples lie along an axis, and how far from the first.

    Beyond the outermost middles both are the outermost bin.
    """
    place = (np.arange(samples) + 0.5) * (bins / samples) - 0.5
    below = np.floor(place).astype(int)
    return np.clip(below, 0, bins - 1), np.clip(below + 1, 0, bins - 1), place - below


def _linear(values: Floats, axis: int, low: Integers, high: Integers, part: Floats) -> tuple[Floats, Floats]:
    """Return values between bins of an axis, as `_between` has them, and their change from bin to bin."""
    first, last = (np.take(values, k, axis) for k in (low, high))
    change = last - first
    return first + part.reshape(-1, *[1] * (values.ndim - 1 - axis)) * change, change


def _binned(
    sent: Sequence[Floats], beside: Sequence[Floats], light: Floats, bins: Sequence[int]
) -> list[Floats]:
    """Return d on bins of the target, where light is sent to and else that of the nearest bin."""
    i, j = (np.clip((t + 1) * (n / 2), 0, n - 1).astype(int) for t, n in zip(sent, bins))
    which = (i * bins[1] + j).ravel()

    def gathered(values: Floats) -> Floats:
        total = np.bincount(which, values.ravel(), bins[0] * bins[1]).reshape(bins)
        return np.asarray(gaussian_filter(total, 1.0, mode="nearest"))

    flux = gathered(light)
    few = flux <= FEW * flux.mean()
    nearest = tuple(distance_transform_edt(few, return_distances=False, return_indices=True))
    return [(gathered(light * d) / np.where(few, 1.0, flux))[nearest] for d in beside]
