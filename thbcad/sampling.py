"""Sampled functions, and the knots, leaf cells and sample points of a THB space.

At level l every non-empty span of the first knot vector is cut into 2^l equal parts.  Old knots
keep their multiplicity, new knots are simple.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from thbcad.bspline import KnotVector
from thbcad.space import THBSpace

Function = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def level_breaks(kv: KnotVector, level: int, index: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the breaks with the given indices among the ``kv.spans * 2^level + 1`` breaks of a level."""
    old, part = np.divmod(index, 1 << level)
    right = kv.breaks[np.minimum(old + 1, kv.spans)]
    return kv.breaks[old] + (right - kv.breaks[old]) * (part / (1 << level))


def level_knots(kv: KnotVector, level: int, index: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the knots t_k of a level for the given indices k."""
    count = np.unique(kv.knots, return_counts=True)[1]
    first = (np.arange(kv.spans + 1) << level) + np.cumsum(count - 1) - (count - 1)  # first knot at every old break
    old = np.searchsorted(first, index, "right") - 1
    return level_breaks(kv, level, (old << level) + np.maximum(index - first[old] - (count[old] - 1), 0))


def cell_boxes(space: THBSpace) -> NDArray[np.float64]:
    """Return the corners of the leaf cells in the order of ``space.cells``, (cells, 2, 2) float [[u_0, u_1], [v_0, v_1]]."""
    level, i, j = space.cells.T
    boxes = np.empty((len(level), 2, 2))
    for number in np.unique(level).tolist():
        here = level == number
        for axis, (kv, low) in enumerate(((space.kv_u, i[here]), (space.kv_v, j[here]))):
            boxes[here, axis] = level_breaks(kv, number, low[:, None] + np.arange(2))
    return boxes


def cell_points(
    boxes: NDArray[np.float64], shares_u: NDArray[np.float64], shares_v: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (u, v), each (cells, n_u n_v): the points at the given shares of every cell's sides, u first, then v."""
    u, v = (box[:, :1] + (box[:, 1:] - box[:, :1]) * shares for box, shares in ((boxes[:, 0], shares_u), (boxes[:, 1], shares_v)))
    return np.repeat(u, len(shares_v), axis=1), np.tile(v, len(shares_u))


def gauss_points(space: THBSpace) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return (u, v, weights), (n,) each: Gauss quadrature with (p + 1)(q + 1) points on every leaf cell.

    Exact for products of two splines of the space, and for products of their derivatives.
    """
    (x, wx), (y, wy) = (np.polynomial.legendre.leggauss(kv.degree + 1) for kv in (space.kv_u, space.kv_v))
    boxes = cell_boxes(space)
    u, v = cell_points(boxes, (1 + x) / 2, (1 + y) / 2)
    weights = np.outer(np.diff(boxes, axis=2).prod(axis=(1, 2)), np.outer(wx, wy) / 4)
    return u.ravel(), v.ravel(), weights.ravel()


def evaluate(function: Function, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return function(u, v) as float64, (n,) or (n, d), at points of shape (n,).

    Raises
    ------
    ValueError : values of another shape, or not finite.
    """
    values = np.asarray(function(u, v), dtype=np.float64)
    if values.shape[:1] != u.shape or values.ndim > 2:
        raise ValueError(f"the function must return ({len(u)},) or ({len(u)}, d) values for {len(u)} points, got shape {values.shape}")
    finite = np.isfinite(values.reshape(len(u), -1)).all(axis=1)
    if not finite.all():
        k = int(np.argmin(finite))
        raise ValueError(f"the function is not finite at u = {u[k]}, v = {v[k]}")
    return values
