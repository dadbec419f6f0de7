"""Exact restriction to a coarser THB space, for one level of cells made whole again.

Functions that are active in both spaces keep their coefficients.  A function that only the coarser
space has is determined on whole cells inside its support.  There the spline has its coefficients c in
the coarser knots and B c in the finer ones, B the two-scale relation in one direction and then the
other; the rows of the pseudo-inverses take them back.  Splines of the coarser space satisfy the
relation, hence Q P = I.  Of all rectangles of whole cells the one of least norm is taken: the
weights stay small for any knots, where point values would lose digits with the degree.

A coefficient can be computed on any rectangle of leaf cells in the support of its B-spline: the more
cells, the less a functional magnifies rounding errors.

Source: C. Giannelli, B. Juettler, H. Speleers, Strongly stable bases for adaptively refined
multilevel spline spaces, Adv. Comput. Math. 40 (2014).
"""

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from thbcad.checks import Bools, Floats, Integers
from thbcad.hierarchy.level_nets import Nets
from thbcad.hierarchy.levels import DyadicAxis, Level

GREATEST_NORM = 1e12  # four of the sixteen digits of float64 are left


# functionals of n B-splines on all m intervals of their supports in one direction, (n, m, ...) each: their
# norms, inf where the support has no such interval, and what they are made of
Table = tuple[Floats, Any, Floats]


def best_functionals(
    level: Level, functions: Integers, table_of: Callable[[DyadicAxis, int, Integers], Table]
) -> tuple[Floats, list[tuple[Any, Floats]]]:
    """Return the norms, (n,), of the functionals of least norm of B-splines of a level, and what they consist
    of in u and in v.

    functions : (n, 2) int.  table_of : of an axis, the level and distinct functions along the axis
    """
    tables = []
    rows = []
    for axis, index in zip(level.axes, functions.T):
        distinct, inverse = np.unique(index, return_inverse=True)
        tables.append(table_of(axis, level.number, distinct))
        rows.append(inverse)
    norms_u, norms_v = (norms[row] for (norms, _, _), row in zip(tables, rows))
    choice, norms = least_norm(whole_cells(level, functions), norms_u, norms_v)
    return norms, [(of[r, c], weights[r, c]) for (_, of, weights), r, c in zip(tables, rows, choice)]


def least_norm(leaves: Bools, norms_u: Floats, norms_v: Floats) -> tuple[Integers, Floats]:
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


def whole_cells(level: Level, functions: Integers) -> Bools:
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


def restriction(coarser: Sequence[Level], finer: Nets, level: int) -> csr_array:
    """Return Q where the finer space refines only more cells of one level than the coarser one."""
    indices = []
    for coarse, fine, start in zip(coarser, finer.hierarchy, finer.starts):
        at = fine.find(coarse.functions[coarse.active])
        order = np.cumsum(fine.active) - 1
        indices.append(np.where((at >= 0) & fine.active[at], start + order[at], -1))
    lost = indices[level] < 0
    index = np.concatenate(indices)
    rows = np.flatnonzero(index >= 0)
    keep = csr_array((np.ones(len(rows)), (rows, index[rows])), shape=(len(index), finer.dim))
    if not lost.any():
        return keep
    weights = _dual_weights(coarser[level], finer.hierarchy[level + 1], lost)
    *_, net = (net for number, net in zip(range(level + 2), finer.operators(finer.active)))
    rows = np.flatnonzero(index < 0)
    insertion = csr_array((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(len(index), len(rows)))
    return csr_array(keep + insertion @ (weights @ net))


def require_restored(operator: csr_array) -> None:
    """Raise ValueError when the steps of a restriction, multiplied, leave fewer than four digits: its
    rounding error is |Q| EPS."""
    norm = abs(operator).sum(axis=1).max(initial=0)
    if not norm <= GREATEST_NORM:
        raise ValueError(
            f"the levels cannot be restored at once in float64: the operator has norm {norm:.2g}; restrict "
            "to fewer levels"
        )


def _dual_weights(coarse: Level, fine: Level, lost: Bools) -> csr_array:
    """Return the weights of the finer level's net, (n, size), that give the lost functions' coefficients."""
    functions = coarse.functions[coarse.active][lost]
    norm, ((first_u, by_u), (first_v, by_v)) = best_functionals(coarse, functions, _inverses)
    if not np.isfinite(norm).all():
        i, j = functions[~np.isfinite(norm)][0]
        raise ValueError(
            f"function ({i}, {j}) of level {coarse.number} cannot be restored in float64: "
            "the knots around its whole cells are too unequal; make more cells whole"
        )
    owner, a, b = np.nonzero((by_u != 0)[:, :, None] & (by_v != 0)[:, None, :])
    columns = fine.find(np.stack([first_u[owner] + a, first_v[owner] + b], axis=1))
    return csr_array(
        (by_u[owner, a] * by_v[owner, b], (owner, columns)), shape=(len(functions), len(fine.keys))
    )


def _inverses(axis: DyadicAxis, level: int, functions: Integers) -> Table:
    """Return the functionals of distinct B-splines of a level: rows of pseudo-inverses of two-scale
    relations.

    Their norms and their first B-splines of the next level, (n, m) each; weights of these and those that
    follow, (n, m, 3 p + 2), zero beyond those in use.
    """
    p = axis.degree
    head, tail = axis.support(level, functions)
    start, stop = intervals(p + 1).T
    owner, number = np.nonzero(stop <= (tail - head)[:, None])
    low, high = head[owner] + start[number], head[owner] + stop[number]  # spans low ... high - 1
    coarse, fine = axis.acting(level, low), axis.acting(level + 1, 2 * low)
    columns = axis.acting(level, high - 1) + p + 1 - coarse
    rows = axis.acting(level + 1, 2 * high - 1) + p + 1 - fine
    norms = np.full((len(functions), len(start)), np.inf)
    first = np.zeros(norms.shape, dtype=np.int64)
    weights = np.zeros((*norms.shape, 3 * p + 2))
    for r, c in np.unique(np.stack([rows, columns], axis=1), axis=0).tolist():
        here = (rows == r) & (columns == c)
        at = owner[here], number[here]
        blocks = _two_scale_blocks(axis, level, fine[here], coarse[here], (r, c))
        first[at] = fine[here]
        weights[*at, :r], norms[at] = _inverse_rows(blocks, functions[at[0]] - coarse[here])
    return norms, first, weights


def _two_scale_blocks(
    axis: DyadicAxis, level: int, fine: Integers, coarse: Integers, shape: tuple[int, int]
) -> Floats:
    """Return the blocks of the two-scale relation that start at rows `fine` and columns `coarse`, (n,
    *shape)."""
    all_rows, all_columns = (np.unique(at[:, None] + np.arange(n)) for at, n in zip((fine, coarse), shape))
    step = axis.two_scale(level + 1, all_rows, all_columns)
    wanted = np.searchsorted(all_rows, fine[:, None] + np.arange(shape[0]))
    count = np.diff(step.indptr)[wanted]
    k = np.arange(count.max())
    n, row, k = np.nonzero(k < count[:, :, None])
    entry = step.indptr[wanted[n, row]] + k
    blocks = np.zeros((len(fine), *shape))
    blocks[n, row, all_columns[step.indices[entry]] - coarse[n]] = step.data[entry]
    return blocks


def _inverse_rows(blocks: Floats, target: Integers) -> tuple[Floats, Floats]:
    """Return row `target` of the pseudo-inverse of every block and its norm, (n, r, c) and (n,) -> (n, r) and
    (n,), by QR.

    Columns are scaled to a maximum of 1: on graded knots they differ by many orders of magnitude.
    The norm is inf where it would leave fewer than four digits.
    """
    scale = blocks.max(axis=1)
    scaled = blocks / scale[:, None, :]
    q, r = np.linalg.qr(scaled)
    unit = (np.arange(r.shape[1]) == target[:, None]) / scale
    rows = np.zeros(blocks.shape[:2])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(2):  # the second time for the residual
            solved = unit - np.einsum("nr,nrc->nc", rows, scaled)
            for k in range(r.shape[1]):  # R^T y = e, row by row
                solved[:, k] = (solved[:, k] - np.einsum("nj,nj->n", r[:, :k, k], solved[:, :k])) / r[:, k, k]
            rows = rows + np.einsum("nrc,nc->nr", q, solved)
        norm = abs(rows).sum(axis=1)
    return rows, np.where(norm < GREATEST_NORM, norm, np.inf)
