"""Rectangles of leaf cells inside the supports of B-splines.

A coefficient can be computed on any rectangle of leaf cells in the support of its B-spline: the more
cells, the less a functional magnifies rounding errors.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from thbcad.checks import Floats, Integers
from thbcad.hierarchy.levels import Level


def least_norm(leaves: NDArray[np.bool_], norms_u: Floats, norms_v: Floats) -> tuple[Integers, Floats]:
    """Return the rectangle of leaf cells of least norm in every support: the numbers of its intervals, (2,
    n), and the norms, (n,).

    leaves : (n, p + 1, q + 1), which cells of the supports are leaf cells
    norms_u, norms_v : (n, intervals), of the functionals in one direction; inf for those that do not serve
    """
    count = np.zeros((len(leaves), leaves.shape[1] + 1, leaves.shape[2] + 1), dtype=np.int64)
    count[:, 1:, 1:] = leaves.cumsum(axis=1).cumsum(axis=2)
    (low, high), best = intervals(leaves.shape[2]).T, np.full(len(leaves), np.inf)
    choice = np.zeros((2, len(leaves)), dtype=np.int64)
    for number, (start, stop) in enumerate(intervals(leaves.shape[1])):
        strip = count[:, stop] - count[:, start]
        whole = strip[:, high] - strip[:, low] == (stop - start) * (high - low)
        norm = np.where(whole, norms_u[:, number, None] * norms_v, np.inf)
        least = norm.argmin(axis=1)
        norm = norm[np.arange(len(norm)), least]
        better = norm < best
        best[better] = norm[better]
        choice[:, better] = np.full(better.sum(), number), least[better]
    return choice, best


def whole_cells(level: Level, functions: Integers) -> NDArray[np.bool_]:
    """Return which cells of the supports of functions of a level are its leaf cells, (n, 2) int -> (n, p + 1,
    q + 1)."""
    sides = []
    for d, axis in enumerate(level.axes):
        head, tail = axis.support(level.number, functions[:, d])
        spans = head[:, None] + np.arange(axis.degree + 1)
        sides.append((spans, spans < tail[:, None]))
    (i, in_u), (j, in_v) = sides
    width = level.axes[1].spans(level.number)
    leaves = level.leaves[:, 0] * width + level.leaves[:, 1]
    return np.isin(i[:, :, None] * width + j[:, None, :], leaves) & in_u[:, :, None] & in_v[:, None, :]


def intervals(spans: int) -> Integers:
    """Return all (start, stop) with 0 <= start < stop <= spans, shortest first."""
    pairs = np.array(list(combinations(range(spans + 1), 2)))
    return pairs[np.argsort(pairs[:, 1] - pairs[:, 0], kind="stable")]
