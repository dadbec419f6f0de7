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
from thbcad.embedding import Embedding
from thbcad.hierarchy import DyadicAxis, Level


def prolongation(hierarchy: Sequence[Level], target: Embedding) -> csr_array:
    """Return P from the space of `hierarchy` to the finer space of `target`."""
    own = [target.positions(number, level)[level.active] for number, level in enumerate(hierarchy)]
    own += [np.zeros(0, dtype=np.int64)] * (len(target.active) - len(hierarchy))
    nets = target.operators(own, sum(int(level.active.sum()) for level in hierarchy))
    return csr_array(vstack([net[rows] for net, rows in zip(nets, target.active)], format="csr"))


def restriction(
    coarser: Sequence[Level], finer: Sequence[Level], embedding: Embedding, axes: Sequence[DyadicAxis], level: int
) -> csr_array:
    """Return Q where the finer space refines only more cells of one level than the coarser one.

    embedding : of the finer space.
    """
    kept = [_find(c.functions, f.functions) for c, f in zip(coarser, finer)]
    starts = np.cumsum([0] + [int(f.active.sum()) for f in finer])
    index = np.concatenate([np.where(k < 0, -1, k + start) for k, start in zip(kept, starts)])
    rows = np.flatnonzero(index >= 0)
    keep = csr_array((np.ones(len(rows)), (rows, index[rows])), shape=(len(index), embedding.dim))
    lost = kept[level] < 0
    if not lost.any():
        return keep
    weights = _dual_weights(coarser[level], lost, embedding, axes, level)
    *_, net = (net for number, net in zip(range(level + 2), embedding.operators(embedding.active, embedding.dim)))
    rows = np.flatnonzero(index < 0)
    place = csr_array((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(len(index), len(rows)))
    return csr_array(keep + place @ (weights @ net))


def _find(wanted: NDArray[np.int64], functions: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the index of each wanted (i, j) in the sorted rows `functions`, -1 where missing."""
    if len(functions) == 0:
        return np.full(len(wanted), -1)
    width = max(int(functions[:, 1].max()), int(wanted[:, 1].max(initial=0))) + 1
    keys, sought = (f[:, 0] * width + f[:, 1] for f in (functions, wanted))
    at = np.minimum(np.searchsorted(keys, sought), len(keys) - 1)
    return np.where(keys[at] == sought, at, -1)


def _dual_weights(coarser: Level, lost: NDArray[np.bool_], embedding: Embedding, axes: Sequence[DyadicAxis], level: int) -> csr_array:
    """Return the weights of the net of W_(level + 1), (n, size), that give the lost functions' coefficients."""
    functions, heads = coarser.functions[lost], coarser.heads[coarser.active][lost]
    cell = _middle_leaf(coarser, functions, heads, axes, level)
    shape = embedding.shape(level + 1)
    first, weights = [], []
    for d, axis in enumerate(axes):
        rank = functions[:, d] - axis.first_knot(level, heads[:, d])
        own = embedding.first_at(level, d, level, heads[:, d]) + rank
        at, values = _local_inverse(embedding, d, level, cell[:, d], own)
        first.append(at)
        weights.append(values)
    rows, columns = (at[:, None] + np.arange(w.shape[1]) for at, w in zip(first, weights))
    columns = rows[:, :, None] * shape[1] + columns[:, None, :]
    values = weights[0][:, :, None] * weights[1][:, None, :]
    return csr_rows(values, columns, shape[0] * shape[1])


def _middle_leaf(
    coarser: Level, functions: NDArray[np.int64], heads: NDArray[np.int64], axes: Sequence[DyadicAxis], level: int
) -> NDArray[np.int64]:
    """Return for each function the leaf cell (i, j) of its level nearest to the middle of its support."""
    lengths = [axis.support_length(level, functions[:, d], heads[:, d]) for d, axis in enumerate(axes)]
    leaves = coarser.leaves
    best, least = heads.copy(), np.full(len(heads), np.iinfo(np.int64).max)
    for a in range(axes[0].degree + 1):
        for b in range(axes[1].degree + 1):
            i = np.minimum(np.searchsorted(coarser.rows, heads[:, 0] + a), len(coarser.rows) - 1)
            j = np.minimum(np.searchsorted(coarser.columns, heads[:, 1] + b), len(coarser.columns) - 1)
            off = (2 * a + 1 - lengths[0]) ** 2 + (2 * b + 1 - lengths[1]) ** 2
            better = (a < lengths[0]) & (b < lengths[1]) & leaves[i, j] & (off < least)
            least[better] = off[better]
            best[better] = heads[better] + [a, b]
    return best


def _local_inverse(
    embedding: Embedding, direction: int, level: int, spans: NDArray[np.int64], own: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return (first, weights), (n,) and (n, p + 2), of the finer coefficients around each span.

    own : positions in W_level of the functions whose coefficients are wanted.
    """
    step = embedding.steps[level][direction].tocsr()
    p = embedding.knot_vectors(level)[direction].degree
    distinct, inverse = np.unique(spans, return_inverse=True)
    coarse = embedding.last_at(level, direction, level, distinct) - p
    fine = embedding.last_at(level + 1, direction, level, distinct) - p
    blocks = np.stack([step[f : f + p + 2, c : c + p + 1].toarray() for f, c in zip(fine.tolist(), coarse.tolist())])
    inverses = np.linalg.pinv(blocks)
    return fine[inverse], inverses[inverse, own - coarse[inverse]]
