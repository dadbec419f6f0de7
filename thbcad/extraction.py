"""Local B-spline coefficients of a THB spline on its leaf cells.

On a leaf cell of level l a THB spline is an ordinary spline of level l.  Its (p + 1)(q + 1)
coefficients there are polar forms at the level's own knots around the cell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from thbcad.bspline import blossom_rows, csr_rows
from thbcad.embedding import Embedding
from thbcad.hierarchy import DyadicAxis, Level


def extraction(hierarchy: Sequence[Level], embedding: Embedding, axes: Sequence[DyadicAxis]) -> csr_array:
    """Return the operator, csr_array (cells (p + 1)(q + 1), dim), from THB to local coefficients.

    Rows run over the leaf cells in their order, then over the functions of the cell in u, then in v.
    """
    nets = embedding.operators(embedding.active, embedding.dim)
    parts = []
    for number, (level, net) in enumerate(zip(hierarchy, nets)):
        i, j = np.nonzero(level.leaves)
        if len(i) == 0:
            continue
        at_u, u = _local_change(embedding, axes[0], 0, number, level.rows)
        at_v, v = _local_change(embedding, axes[1], 1, number, level.columns)
        p, q = u.shape[1], v.shape[1]
        values = u[i][:, :, None, :, None] * v[j][:, None, :, None, :]
        columns = (at_u[i][:, None] + np.arange(p))[:, :, None] * embedding.shape(number)[1] + (at_v[j][:, None] + np.arange(q))[:, None, :]
        columns = np.broadcast_to(columns[:, None, None], values.shape)
        parts.append(csr_rows(values.reshape(-1, p * q), columns.reshape(-1, p * q), net.shape[0]) @ net)
    return csr_array(vstack(parts, format="csr"))


def _local_change(
    embedding: Embedding, axis: DyadicAxis, direction: int, level: int, spans: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return (first, matrices), (n,) and (n, p + 1, p + 1): from W_level's coefficients on spans to the level's own."""
    p = axis.degree
    kv = embedding.knot_vectors(level)[direction]
    span = embedding.last_at(level, direction, level, spans)
    knots = np.stack([axis.knots_around(level, s) for s in spans.tolist()])
    arguments = knots[:, np.arange(p + 1)[:, None] + np.arange(p)].reshape(-1, p)
    rows = blossom_rows(kv.knots, p, np.repeat(span, p + 1), arguments)
    return span - p, rows.reshape(-1, p + 1, p + 1)
