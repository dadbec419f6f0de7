"""Exact transfer between nested THB spaces.

Prolongation: the coefficient of an active function of the finer space is the coefficient that
the spline has there in the level's own B-spline basis (preservation of coefficients).

Restriction, for one level of cells made whole again: functions that are active in both spaces
keep their coefficients.  A function that only the coarser space has is found on a whole cell C
in its support: there the spline has p + 2 coefficients per direction in the finer knots and
p + 1 in the coarser ones, and the pseudo-inverse of the local two-scale relation takes one to
the other.  Splines of the coarser space satisfy the relation, hence Q P = I; the weights stay
small, where point values would lose digits with the degree.

Source: C. Giannelli, B. Juettler, H. Speleers, Strongly stable bases for adaptively refined
multilevel spline spaces, Adv. Comput. Math. 40 (2014).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from thbcad.bspline import csr_rows
from thbcad.hierarchy import DyadicAxis, Integers, Level
from thbcad.nets import Nets


def prolongation(coarser: Nets, finer: Nets) -> csr_array:
    """Return P from the coarser to the finer space."""
    own = [fine.find(coarse.functions[coarse.active]) for coarse, fine in zip(coarser.hierarchy, finer.hierarchy)]
    own += [np.zeros(0, dtype=np.int64)] * (len(finer.sizes) - len(own))
    nets = finer.operators(own)
    return csr_array(vstack([net[rows] for net, rows in zip(nets, finer.active)], format="csr"))


def hierarchical(nets: Nets) -> csr_array:
    """Return the change from coefficients by the hierarchical (not truncated) B-splines to those by the truncated ones."""
    whole = nets.operators(nets.active, truncated=False)
    return csr_array(vstack([net[rows] for net, rows in zip(whole, nets.active)], format="csr"))


def restriction(coarser: Sequence[Level], finer: Nets, level: int) -> csr_array:
    """Return Q where the finer space refines only more cells of one level than the coarser one."""
    starts = np.cumsum([0] + [len(rows) for rows in finer.active])
    index = []
    for coarse, fine, start in zip(coarser, finer.hierarchy, starts):
        at = fine.find(coarse.functions[coarse.active])
        order = np.cumsum(fine.active) - 1
        index.append(np.where((at >= 0) & fine.active[at], start + order[at], -1))
    lost = index[level] < 0
    index = np.concatenate(index)
    rows = np.flatnonzero(index >= 0)
    keep = csr_array((np.ones(len(rows)), (rows, index[rows])), shape=(len(index), finer.dim))
    if not lost.any():
        return keep
    weights = _dual_weights(coarser[level], finer.hierarchy[level + 1], lost)
    *_, net = (net for number, net in zip(range(level + 2), finer.operators(finer.active)))
    rows = np.flatnonzero(index < 0)
    place = csr_array((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(len(index), len(rows)))
    return csr_array(keep + place @ (weights @ net))


def _dual_weights(coarse: Level, fine: Level, lost: NDArray[np.bool_]) -> csr_array:
    """Return the weights of the finer level's net, (n, size), that give the lost functions' coefficients."""
    functions = coarse.functions[coarse.active][lost]
    cell = _middle_leaf(coarse, functions)
    first, weights = zip(*(_local_inverse(axis, coarse.number, cell[:, d], functions[:, d]) for d, axis in enumerate(coarse.axes)))
    rows, columns = (at[:, None] + np.arange(w.shape[1]) for at, w in zip(first, weights))
    positions = fine.find(np.stack(np.broadcast_arrays(rows[:, :, None], columns[:, None, :]), axis=-1))
    values = weights[0][:, :, None] * weights[1][:, None, :]
    return csr_rows(values, positions, len(fine.keys))


def _middle_leaf(level: Level, functions: Integers) -> Integers:
    """Return for each function the leaf cell (i, j) of its level nearest to the middle of its support, (n, 2) int."""
    (head_u, tail_u), (head_v, tail_v) = (axis.support(level.number, functions[:, d]) for d, axis in enumerate(level.axes))
    leaves = level.leaves
    width = level.axes[1].spans(level.number)
    keys = leaves[:, 0] * width + leaves[:, 1]
    best, least = np.stack([head_u, head_v], axis=1), np.full(len(functions), np.iinfo(np.int64).max)
    for a in range(level.axes[0].degree + 1):
        for b in range(level.axes[1].degree + 1):
            i, j = head_u + a, head_v + b
            wanted = i * width + j
            exists = keys[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] == wanted
            off = (i + i + 1 - head_u - tail_u) ** 2 + (j + j + 1 - head_v - tail_v) ** 2
            better = (i < tail_u) & (j < tail_v) & exists & (off < least)
            least[better] = off[better]
            best[better] = np.stack([i, j], axis=1)[better]
    return best


def _local_inverse(axis: DyadicAxis, level: int, spans: Integers, functions: Integers) -> tuple[Integers, NDArray[np.float64]]:
    """Return (first, weights), (n,) and (n, p + 2): coefficients of level functions from those of level + 1 around each span."""
    p = axis.degree
    distinct, inverse = np.unique(spans, return_inverse=True)
    coarse, fine = axis.acting(level, distinct), axis.acting(level + 1, 2 * distinct)
    rows = np.unique(fine[:, None] + np.arange(p + 2))
    columns = np.unique(coarse[:, None] + np.arange(p + 1))
    step = axis.two_scale(level + 1, rows, columns)
    at_row, at_column = np.searchsorted(rows, fine).tolist(), np.searchsorted(columns, coarse).tolist()
    blocks = np.stack([step[r : r + p + 2, c : c + p + 1].toarray() for r, c in zip(at_row, at_column)])
    inverses = np.linalg.pinv(blocks)
    return fine[inverse], inverses[inverse, functions - coarse[inverse]]
