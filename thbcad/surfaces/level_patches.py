"""Exact B-spline patches of a THB surface: rectangles of cells of one level.

On its leaf cells a THB spline of level l is an ordinary spline of that level.  The leaf cells of
every level are tiled with the fewest rectangles; the coefficients of a patch are polar forms at
its knots, so that nothing is fitted.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_array

from thbcad.checks import Floats, Integers
from thbcad.hierarchy import DyadicAxis, THBSpace
from thbcad.splines import KnotVector, band_matrix, blossom, tensor_apply
from thbcad.surfaces.rectangle_partition import rectangles


def cell_rectangles(space: THBSpace) -> Integers:
    """Return the fewest rectangles of same-level leaf cells, (n, 5) int [level, i0, i1, j0, j1)."""
    rows = []
    for level in space.hierarchy:
        boxes = rectangles(level.leaves)
        rows.append(np.column_stack([np.full(len(boxes), level.number), boxes]))
    return np.concatenate(rows)


def patches(space: THBSpace, coefficients: Floats) -> Iterator[tuple[KnotVector, KnotVector, Floats]]:
    """Yield (knot vector in u, knot vector in v, net) of every patch, nets (n_u, n_v, ...)."""
    nets = list(space.nets.coefficients(coefficients))
    known: dict[tuple[int, int, int, int], tuple[KnotVector, csr_array, Integers]] = {}
    for number, i0, i1, j0, j1 in cell_rectangles(space).tolist():
        level = space.hierarchy[number]
        sides = []
        for d, (start, stop) in enumerate(((i0, i1), (j0, j1))):
            key = number, d, start, stop
            if key not in known:
                known[key] = _side(level.axes[d], number, start, stop)
            sides.append(known[key])
        (kv_u, by_u, rows), (kv_v, by_v, columns) = sides
        at = level.find(np.stack(np.broadcast_arrays(rows[:, None], columns), axis=-1))
        yield kv_u, kv_v, tensor_apply(by_u, by_v, nets[number][at])


def _side(axis: DyadicAxis, level: int, start: int, stop: int) -> tuple[KnotVector, csr_array, Integers]:
    """Return the clamped knots of [start, stop), the operator to their coefficients and the functions it
    applies to."""
    p = axis.degree
    breaks = np.arange(start, stop + 1)
    count = axis.multiplicity(level, breaks)
    count[[0, -1]] = p + 1
    patch = KnotVector(p, np.repeat(axis.value(level, breaks), count))
    spans = np.repeat(breaks[:-1], count[:-1])
    first = axis.acting(level, spans)
    functions = np.arange(first[0], first[-1] + p + 1)
    weights = blossom(axis.knots_around(level, spans), patch.inner_knots())
    return patch, band_matrix(first - first[0], weights, len(functions)), functions
