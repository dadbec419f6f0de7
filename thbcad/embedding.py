"""Exact embedding of a THB space into a tensor-product spline space.

W_l is the tensor-product space on the level-0 knots and only those dyadic knots up to level
l that some refined cell needs.  Every active function of level l is a B-spline of W_l, so a
THB spline with coefficients c_l is found by "refine, then overwrite":

    G_0 = c_0,    G_l = P_u G_(l-1) P_v^T,    then G_l[active] = c_l,

and the last G is its exact tensor-product form.  Overwriting is the truncation.  All weights
are non-negative and sum to one: the operation is stable at any depth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, kron

from thbcad.bspline import KnotVector, tensor_apply
from thbcad.hierarchy import DyadicAxis, Level


class Embedding:
    """The chain W_0, W_1, ... of tensor-product spaces of a hierarchy.

    kv_u, kv_v : KnotVector of the last (finest) one
    supported, active : per level, the flat positions in W_l of the functions supported in
        Omega_l, and of those that are active
    """

    def __init__(self, axes: Sequence[DyadicAxis], hierarchy: Sequence[Level]) -> None:
        self._axes = axes
        self._hierarchy = hierarchy
        top = len(hierarchy) - 1
        keys = [np.zeros(0, dtype=np.int64)] * 2
        # per level and direction: (KnotVector, integer keys on the top level's scale)
        self._chain: list[list[tuple[KnotVector, NDArray[np.int64]]]] = []
        for number, level in enumerate(hierarchy):
            self._chain.append([axis.knots_with(top, k) for axis, k in zip(axes, keys)])
            for d, index in enumerate((level.rows[level.refined.any(axis=1)], level.columns[level.refined.any(axis=0)])):
                middle = ((2 * index + 1) << (top - number)) >> 1
                keys[d] = np.concatenate([keys[d], middle])
        (self.kv_u, _), (self.kv_v, _) = self._chain[-1]
        self.supported = [self.positions(number, level) for number, level in enumerate(hierarchy)]
        self.active = [rows[level.active] for rows, level in zip(self.supported, hierarchy)]
        self.dim = sum(len(rows) for rows in self.active)

    def shape(self, number: int) -> tuple[int, int]:
        """Return the shape of the nets of W_l."""
        (u, _), (v, _) = self._chain[number]
        return u.dim, v.dim

    def positions(self, number: int, level: Level) -> NDArray[np.int64]:
        """Return where the supported functions of a level record sit in the flat net of W_l."""
        index = []
        for d, axis in enumerate(self._axes):
            head = level.heads[:, d]
            rank = level.supported[:, d] - axis.first_knot(number, head)
            index.append(self.first_at(number, d, number, head) + rank)
        return index[0] * self.shape(number)[1] + index[1]

    def first_at(self, number: int, direction: int, level: int, breaks: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the index in W_number's knots of the first knot at breaks of a level."""
        keys = self._chain[number][direction][1]
        return np.searchsorted(keys, breaks << (len(self._hierarchy) - 1 - level))

    def last_at(self, number: int, direction: int, level: int, breaks: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the index in W_number's knots of the last knot at breaks of a level."""
        keys = self._chain[number][direction][1]
        return np.searchsorted(keys, breaks << (len(self._hierarchy) - 1 - level), side="right") - 1

    @cached_property
    def steps(self) -> list[tuple[csr_array, csr_array]]:
        """One-dimensional refinement operators (P_u, P_v) from W_(l-1) to W_l."""
        return [tuple(a.prolongation(b) for (a, _), (b, _) in zip(*pair)) for pair in zip(self._chain, self._chain[1:])]

    def refined(self, number: int, net: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return P_u net P_v^T, a net of W_(number - 1) in W_number."""
        pu, pv = self.steps[number - 1]
        return np.ascontiguousarray(tensor_apply(pu, pv, net))

    def refined_adjoint(self, number: int, net: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return P_u^T net P_v, the transpose of `refined`."""
        pu, pv = self.steps[number - 1]
        return np.ascontiguousarray(tensor_apply(pu.T, pv.T, net))

    def coefficients(self, c: ArrayLike) -> NDArray[np.float64]:
        """Return the tensor-product net of the spline with THB coefficients c.

        c : (dim,) or (dim, d).  Returns (n_u, n_v) or (n_u, n_v, d).
        """
        c = np.asarray(c, dtype=np.float64)
        if c.shape[:1] != (self.dim,) or c.ndim > 2:
            raise ValueError(f"coefficients must have shape ({self.dim},) or ({self.dim}, d), got {c.shape}")
        if c.ndim == 2:
            return np.stack([self.coefficients(column) for column in c.T], axis=-1)
        *_, last = self.nets(c)
        return last

    def nets(self, c: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
        """Yield the nets G_0, G_1, ... for scalar coefficients; G_l is the spline on the leaf cells of level l."""
        parts = np.split(c, np.cumsum([len(rows) for rows in self.active])[:-1])
        net = np.zeros(self.shape(0))
        for number, (rows, part) in enumerate(zip(self.active, parts)):
            if number:
                net = self.refined(number, net)
            net.ravel()[rows] = part
            yield net.copy()

    def knot_vectors(self, number: int) -> tuple[KnotVector, KnotVector]:
        """Return the knot vectors of W_l."""
        (u, _), (v, _) = self._chain[number]
        return u, v

    def adjoint(self, net: ArrayLike) -> NDArray[np.float64]:
        """Return E^T net for E = `coefficients`: the gradient by c from the gradient by the net, (dim,)."""
        net = np.array(net, dtype=np.float64, order="C")
        parts = []
        for number in range(len(self.steps), 0, -1):
            rows = self.active[number]
            parts.append(net.ravel()[rows])
            net.ravel()[rows] = 0.0
            net = self.refined_adjoint(number, net)
        parts.append(net.ravel()[self.active[0]])
        return np.concatenate(parts[::-1])

    @cached_property
    def operator(self) -> csr_array:
        """E as a csr_array (n_u * n_v, dim) with read-only entries."""
        *_, last = self.operators(self.active, self.dim)
        last.sum_duplicates()  # sorts too, which scipy would otherwise do in place later
        last.data.flags.writeable = False
        return last

    def operators(self, positions: Sequence[NDArray[np.int64]], dim: int) -> Iterator[csr_array]:
        """Yield "refine, then overwrite" as operators (size of W_l, dim), level by level.

        positions : per level, the flat positions in W_l that the next coefficients overwrite.
        """
        net, start = None, 0
        for number, rows in enumerate(positions):
            size = int(np.prod(self.shape(number)))
            kind = np.int32 if size < np.iinfo(np.int32).max else np.int64
            entries = rows.astype(kind), np.arange(start, start + len(rows), dtype=kind)
            place = csr_array((np.ones(len(rows)), entries), shape=(size, dim))
            if number:
                keep = np.ones(size)
                keep[rows] = 0.0
                step = kron(*self.steps[number - 1], format="csr")
                step.data *= np.repeat(keep, np.diff(step.indptr))
                step.eliminate_zeros()
                place = place + csr_array(step) @ net
            net = csr_array(place)
            start += len(rows)
            yield net
