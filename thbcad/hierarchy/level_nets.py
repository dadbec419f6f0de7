"""The coefficients of a THB spline on every level, on that level's cells only, and the B-splines that act on
every leaf cell.

G_l holds the coefficients, by the B-splines of level l, that the spline has on Omega_l less
what deeper levels add:

    G_0 = c_0,    G_l = S_l G_(l-1),    then G_l[active] = c_l,

where S_l is the two-scale relation between the functions that act on Omega_(l-1) and on
Omega_l.  Overwriting is the truncation.  On a leaf cell of level l the spline is the B-spline
with the coefficients G_l.  All weights are non-negative and sum to one: the operation is stable
at any depth.  A function of level l on Omega_l needs only coarser functions whose supports hold
its own, and these act on Omega_(l-1): nothing is missing.

(p + 1)(q + 1) B-splines of level l act on such a cell: local extraction and evaluation.

Source: C. Giannelli, B. Juettler, H. Speleers, THB-splines: the truncated basis for
hierarchical splines, CAGD 29 (2012); thesis 3.36-3.39 with two-dimensional masks.  M. Borden,
M. Scott, J. Evans, T. Hughes, Isogeometric finite element data structures based on Bezier
extraction, IJNME 87 (2011); thesis 3.6-3.9.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, vstack

from thbcad.checks import Floats, Integers, locked
from thbcad.hierarchy.levels import Level
from thbcad.splines import bezier_rows, blossom


class Nets:
    """The chain G_0, G_1, ... of a hierarchy.

    sizes : per level, the number of acting functions
    active : per level, the positions of the active ones
    starts : (levels + 1,) int, where the coefficients of every level start, and their number
    """

    def __init__(self, hierarchy: Sequence[Level]) -> None:
        self.hierarchy = tuple(hierarchy)
        self.sizes = tuple(len(level.keys) for level in hierarchy)
        self.active = tuple(locked(np.flatnonzero(level.active)) for level in hierarchy)
        self.starts = locked(np.cumsum([0] + [len(rows) for rows in self.active]))
        self.dim = int(self.starts[-1])

    @cached_property
    def steps(self) -> tuple[csr_array, ...]:
        """Two-scale relations S_l, csr_array (sizes[l], sizes[l - 1]) with read-only entries, from l = 1
        on."""
        steps = tuple(_two_scale(a, b) for a, b in zip(self.hierarchy, self.hierarchy[1:]))
        for step in steps:
            locked(step.data)
        return steps

    def coefficients(self, c: Floats) -> Iterator[Floats]:
        """Yield G_0, G_1, ... for the THB coefficients c, (dim,) or (dim, d)."""
        parts = np.split(c, self.starts[1:-1])
        net = np.zeros((self.sizes[0], *c.shape[1:]))
        for number, (rows, part) in enumerate(zip(self.active, parts)):
            if number:
                net = self.steps[number - 1] @ net
            net[rows] = part
            yield net

    @cached_property
    def operator(self) -> csr_array:
        """All G_l on top of each other as one csr_array (sum of sizes, dim), with read-only entries."""
        whole = csr_array(vstack(list(self.operators(self.active)), format="csr"))
        locked(whole.data)
        return whole

    def operators(self, positions: Sequence[Integers], truncated: bool = True) -> Iterator[csr_array]:
        """Yield "refine, then overwrite" as operators, csr_array (sizes[l], number of positions).

        positions : per level, the positions that the next coefficients overwrite, (n,) int each.
        truncated : False adds the coefficients to what is there instead.
        """
        starts = np.cumsum([0] + [len(rows) for rows in positions])
        net = None
        for number, rows in enumerate(positions):
            shape = self.sizes[number], int(starts[-1])
            selected = csr_array(
                (np.ones(len(rows)), (rows, np.arange(starts[number], starts[number + 1]))), shape=shape
            )
            if number:
                step = self.steps[number - 1]
                selected = selected + (without_rows(step, rows) if truncated else step) @ net
            net = csr_array(selected)
            yield net

    def onto_active(self, operators: Iterable[csr_array]) -> csr_array:
        """Return the rows of the active functions, csr_array (dim, n), of operators onto the nets, csr_array
        (sizes[l], n) each."""
        return csr_array(vstack([net[rows] for net, rows in zip(operators, self.active)], format="csr"))


def without_rows(matrix: csr_array, rows: Integers) -> csr_array:
    """Return the matrix with empty rows in the given positions."""
    keep = np.ones(matrix.shape[0], dtype=bool)
    keep[rows] = False
    entries = np.repeat(keep, np.diff(matrix.indptr))
    counts = np.where(keep, np.diff(matrix.indptr), 0)
    indptr = np.concatenate([[0], np.cumsum(counts)]).astype(matrix.indptr.dtype)
    return csr_array((matrix.data[entries], matrix.indices[entries], indptr), shape=matrix.shape)


def _two_scale(coarse: Level, fine: Level) -> csr_array:
    """Return the operator from the functions on Omega_(l-1) to those on Omega_l."""
    number = fine.number
    width = len(coarse.distinct[1])
    by_u, by_v = (
        axis.two_scale(number, fine.distinct[d], coarse.distinct[d]) for d, axis in enumerate(fine.axes)
    )
    (at_u, n_u), (at_v, n_v) = (
        (by.indptr[rank], np.diff(by.indptr)[rank]) for by, rank in zip((by_u, by_v), fine.ranks)
    )
    count = n_u * n_v
    row = np.repeat(np.arange(len(count)), count)
    rank = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    k_u, k_v = np.divmod(rank, n_v[row])
    k_u += at_u[row]
    k_v += at_v[row]
    keys = by_u.indices[k_u].astype(np.int64) * width + by_v.indices[k_v]
    columns = np.searchsorted(coarse.keys, keys)
    indptr = np.concatenate([[0], np.cumsum(count)])
    return csr_array(
        (by_u.data[k_u] * by_v.data[k_v], columns, indptr), shape=(len(fine.keys), len(coarse.keys))
    )


class LocalBasis:
    """The local B-splines of all leaf cells, in the order of level, i, j.

    blocks : (cells, p + 1, q + 1) int, where their coefficients sit in the nets on top of each other
    """

    def __init__(self, hierarchy: Sequence[Level]) -> None:
        starts = np.cumsum([0] + [len(level.keys) for level in hierarchy])
        self.blocks = locked(
            np.concatenate([level.blocks(level.leaves) + start for level, start in zip(hierarchy, starts)])
        )
        self._knots = tuple(
            np.concatenate([_knots_around(level, d) for level in hierarchy], axis=1) for d in (0, 1)
        )

    def values(
        self, cell: Integers, u: Floats, v: Floats, derivative: tuple[int, int]
    ) -> tuple[Floats, Floats]:
        """Return the functions in u, (n, p + 1), and in v, (n, q + 1), that act at points of leaf cells.

        cell : (n,) int, numbers of leaf cells.  u, v : (n,) float, points in them.  derivative : orders in u
            and in v.
        """
        by_u, by_v = (
            blossom(knots[:, cell], np.broadcast_to(x[:, None], (len(x), len(knots) // 2)), order)
            for knots, x, order in zip(self._knots, (u, v), derivative)
        )
        return by_u, by_v

    def bernstein(self, net: Floats) -> Floats:
        """Return the Bernstein coefficients on every leaf cell from local B-spline coefficients, both (cells,
        p + 1, q + 1, ...)."""
        by_u, by_v = (bezier_rows(knots) for knots in self._knots)
        result: Floats = np.einsum("cki,cij...,clj->ckl...", by_u, net, by_v, optimize=True)
        return result


def _knots_around(level: Level, direction: int) -> Floats:
    """Return the knots on either side of every leaf cell of a level, (2p, cells)."""
    spans, position = np.unique(level.leaves[:, direction], return_inverse=True)
    return level.axes[direction].knots_around(level.number, spans)[:, position]
