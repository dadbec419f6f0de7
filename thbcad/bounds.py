"""Certified bounds of splines from their Bernstein coefficients.

On every cell a spline lies within the convex hull of its Bernstein coefficients, and the corner
coefficients are values.  Subdivision tightens the bounds with the square of the cell size.

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 14.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thbcad.bspline import tensor_apply
from thbcad.surface import BSplineSurface

MOST_CELLS = 200_000
TOLERANCE = 1e-12  # of the greatest coefficient
MOST_STEPS = 40


@dataclass(frozen=True)
class Minimum:
    """lower <= true minimum <= value = s(u, v)."""

    lower: float
    value: float
    u: float
    v: float


def minimum(surface: BSplineSurface) -> Minimum:
    """Return bounds of the least value of a scalar spline, to 1e-12 of its greatest coefficient.

    Branch and bound on Bernstein coefficients.  Where the least value is taken along a whole
    curve the search stops early, with a wider but still certified interval.
    """
    kv_u, kv_v = surface.kv_u, surface.kv_v
    table = tensor_apply(kv_u.bezier(), kv_v.bezier(), surface.coefficients)
    shape = kv_u.spans, kv_u.degree + 1, kv_v.spans, kv_v.degree + 1
    cells = table.reshape(shape).transpose(0, 2, 1, 3).reshape(-1, shape[1], shape[3])
    corner = np.stack(np.meshgrid(kv_u.breaks[:-1], kv_v.breaks[:-1], indexing="ij"), axis=-1).reshape(-1, 2)
    size = np.stack(np.meshgrid(np.diff(kv_u.breaks), np.diff(kv_v.breaks), indexing="ij"), axis=-1).reshape(-1, 2)
    tolerance = TOLERANCE * float(np.abs(surface.coefficients).max())
    best = _least_corner(cells, corner, size)
    for _ in range(MOST_STEPS):
        lower = cells.min(axis=(1, 2))
        open_cells = lower < best[0] - tolerance
        if not open_cells.any() or 4 * open_cells.sum() > MOST_CELLS:
            break
        cells, corner, size = _quartered(cells[open_cells], corner[open_cells], size[open_cells])
        best = min(best, _least_corner(cells, corner, size))
    value, u, v = best
    lower = float(min(value - tolerance, cells.min()))
    return Minimum(lower, value, min(max(u, kv_u.start), kv_u.stop), min(max(v, kv_v.start), kv_v.stop))


def _least_corner(cells: NDArray[np.float64], corner: NDArray[np.float64], size: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return (value, u, v) of the least corner of all cells."""
    values = cells[:, [0, 0, -1, -1], [0, -1, 0, -1]]
    k, c = np.unravel_index(int(np.argmin(values)), values.shape)
    u, v = corner[k] + size[k] * np.array([c // 2, c % 2])
    return float(values[k, c]), float(u), float(v)


def _quartered(
    cells: NDArray[np.float64], corner: NDArray[np.float64], size: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the four halves-by-halves of every cell, by de Casteljau's algorithm."""
    for axis in (1, 2):
        low, high = _halved(np.moveaxis(cells, axis, 0))
        step = np.zeros_like(size)
        step[:, axis - 1] = size[:, axis - 1] / 2
        cells = np.concatenate([np.moveaxis(half, 0, axis) for half in (low, high)])
        corner = np.concatenate([corner, corner + step])
        size = np.concatenate([size - step, size - step])
    return cells, corner, size


def _halved(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the Bernstein coefficients (p + 1, ...) of both halves of the interval."""
    low, high = [rows[0]], [rows[-1]]
    while len(rows) > 1:
        rows = (rows[:-1] + rows[1:]) / 2
        low.append(rows[0])
        high.append(rows[-1])
    return np.stack(low), np.stack(high[::-1])
