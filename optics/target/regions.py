"""Targets that are regions of uniform light.

A region is {(s, t): |s| <= 1, |t - middle(s)| <= half(s)} in coordinates that run from -1 to 1 over
its bounding rectangle, t upward.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SLICES = 32  # per pixel column

Row = NDArray[np.float64]


def _rectangle(s: Row) -> tuple[Row, Row]:
    return np.zeros_like(s), np.ones_like(s)


def _ellipse(s: Row) -> tuple[Row, Row]:
    return np.zeros_like(s), np.sqrt(1 - s * s)


def _crescent(s: Row) -> tuple[Row, Row]:
    """Return a band of constant height along a parabola: middle 1/2 - s^2, height 1."""
    return 0.5 - s * s, np.full_like(s, 0.5)


REGIONS = {"rectangle": _rectangle, "ellipse": _ellipse, "crescent": _crescent}


def uniform_region(shape: str, pixels: tuple[int, int], lit: tuple[float, float]) -> NDArray[np.float64]:
    """Return the fraction of every pixel that a region covers, (rows, columns), row 0 at the top.

    It is exact along t, and summed over 32 slices of every pixel along s.

    shape : a name of `REGIONS`.  pixels : (columns, rows).
    lit : the region's width and height relative to the screen's.
    """
    columns, rows = pixels
    s = ((np.arange(SLICES * columns) + 0.5) / (SLICES * columns) * 2 - 1) / lit[0]
    inside = np.abs(s) <= 1
    middle, half = REGIONS[shape](s[inside])
    top, bottom = ((1 - lit[1] * (middle + sign * half)) / 2 * rows for sign in (1, -1))
    row = np.arange(rows)[:, None]
    covered = np.zeros((rows, SLICES * columns))
    covered[:, inside] = np.clip(np.minimum(bottom, row + 1) - np.maximum(top, row), 0, 1)
    return covered.reshape(rows, columns, SLICES).mean(axis=2)
