"""Targets that are regions of uniform light.

A region is {(s, t): |s| <= 1, |t - middle(s)| <= half(s)} in coordinates that run from -1 to 1 over
its bounding rectangle, t upward.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from thbcad.checks import Bools, Floats

SLICES = 32  # per pixel column


# middle and half by s
REGIONS: dict[str, Callable[[Floats], tuple[Floats, Floats]]] = {
    "rectangle": lambda s: (np.zeros_like(s), np.ones_like(s)),
    "ellipse": lambda s: (np.zeros_like(s), np.sqrt(1 - s * s)),
    "crescent": lambda s: (0.5 - s * s, np.full_like(s, 0.5)),  # a band of height 1 along a parabola
}


def uniform_region(shape: str, pixels: tuple[int, int], lit: tuple[float, float]) -> Floats:
    """Return the fraction of every pixel that a region covers, (rows, columns), row 0 at the top.

    It is exact along t, and summed over 32 slices of every pixel along s.

    shape : a name of `REGIONS`.  pixels : (columns, rows).
    lit : the region's width and height relative to the screen's.
    """
    columns, rows = pixels
    s = ((np.arange(SLICES * columns) + 0.5) / (SLICES * columns) * 2 - 1) / lit[0]
    inside = np.abs(s) <= 1
    middle, half = REGIONS[shape](s[inside])
    ends = np.zeros((2, SLICES * columns))
    ends[:, inside] = [(1 - lit[1] * (middle + sign * half)) / 2 * rows for sign in (1, -1)]
    light = np.zeros((rows, columns))
    slices = (inside.reshape(columns, SLICES), *ends.reshape(2, columns, SLICES))
    for column, (met, top, bottom) in enumerate(zip(*slices)):
        if met.any():
            _fill(light[:, column], met, top, bottom)
    return light


def _fill(light: Floats, met: Bools, top: Floats, bottom: Floats) -> None:
    """Set a column of pixels, (rows,), to the mean over its slices of the fraction that they cover.

    met : the slices that meet the region.  top, bottom : the rows where they enter and leave it.
    """
    rows = len(light)
    low, filled = (int(np.clip(r, 0, rows)) for r in (top[met].min(), np.ceil(top[met].max())))
    emptying, high = (int(np.clip(r, 0, rows)) for r in (bottom[met].min(), np.ceil(bottom[met].max())))
    light[filled:emptying] = met.mean()
    row = np.r_[low:filled, max(filled, emptying) : high][:, None]  # where slices begin or end
    covered = np.zeros((len(row), SLICES))
    covered[:, met] = np.clip(np.minimum(bottom[met], row + 1) - np.maximum(top[met], row), 0, 1)
    light[row[:, 0]] = covered.mean(axis=1)
