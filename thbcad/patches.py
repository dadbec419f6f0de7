"""Exact B-spline patches of a THB surface: rectangles of cells of one level.

On its leaf cells a THB spline of level l is an ordinary spline of that level.  The leaf cells of
every level are tiled with the fewest rectangles; the coefficients of a patch are polar forms at
its knots, so that nothing is fitted.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from thbcad.bspline import KnotVector, band_matrix, blossom_rows
from thbcad.partition import rectangles
from thbcad.space import THBSpace

Operator = tuple[KnotVector, csr_array]


def cell_rectangles(space: THBSpace) -> NDArray[np.int64]:
    """Return the fewest rectangles of same-level leaf cells, (n, 5) int [level, i0, i1, j0, j1)."""
    rows = []
    for number, level in enumerate(space.hierarchy):
        at_i, at_j = _spread(level.rows), _spread(level.columns)
        mask = np.zeros((at_i[-1] + 1, at_j[-1] + 1), dtype=bool)
        mask[np.ix_(at_i, at_j)] = level.leaves
        found = rectangles(mask)
        i0, j0 = (np.searchsorted(at, found[:, k]) for at, k in ((at_i, 0), (at_j, 2)))
        i, j = level.rows[i0], level.columns[j0]
        size = found[:, 1] - found[:, 0], found[:, 3] - found[:, 2]
        rows.append(np.stack([np.full(len(found), number), i, i + size[0], j, j + size[1]], axis=1))
    return np.concatenate(rows)


def patch_operators(space: THBSpace) -> list[tuple[int, Operator, Operator]]:
    """Return per patch (level, (knot vector, operator) in u, the same in v).

    The patch has the coefficients ``A_u @ G_l @ A_v.T`` of the level's net G_l.
    """

    @cache
    def operator(level: int, direction: int, start: int, stop: int) -> Operator:
        axis = space.axes[direction]
        breaks = np.arange(start, stop + 1)
        count = axis.multiplicity(level, breaks)
        count[[0, -1]] = axis.degree + 1
        own = KnotVector(axis.degree, np.repeat(axis.value(level, breaks), count))
        return own, _polar(space.embedding.knot_vectors(level)[direction], own)

    found = cell_rectangles(space).tolist()
    return [(level, operator(level, 0, i0, i1), operator(level, 1, j0, j1)) for level, i0, i1, j0, j1 in found]


def _polar(kv: KnotVector, own: KnotVector) -> csr_array:
    """Return the operator to the coefficients on `own`, a clamped piece of the spline's knots."""
    p = kv.degree
    span = kv.span_of(own.knots[: own.dim])
    arguments = own.knots[np.arange(own.dim)[:, None] + np.arange(1, p + 1)]
    return band_matrix(span - p, blossom_rows(kv.knots, p, span, arguments), kv.dim)


def _spread(numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return positions of sorted numbers in which neighbours stay neighbours and others keep a gap."""
    return np.r_[0, np.cumsum(np.minimum(np.diff(numbers), 2))]
