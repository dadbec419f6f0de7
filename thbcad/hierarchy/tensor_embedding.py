"""Exact embedding of a THB space into a tensor-product spline space.

W_l is the tensor-product space on the level-0 knots and only those dyadic knots up to level
l that some refined cell needs.  Every active function of level l is a B-spline of W_l, so a
THB spline with coefficients c_l follows by "refine, then overwrite":

    G_0 = c_0,    G_l = P_u G_(l-1) P_v^T,    then G_l[active] = c_l,

and the last G is its exact tensor-product form.  Overwriting is the truncation.  All weights
are non-negative and sum to one: the operation is stable at any depth.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from thbcad.checks import Floats, Integers, floats, locked
from thbcad.hierarchy.levels import DyadicAxis, Level
from thbcad.splines import KnotVector, tensor_apply

MOST_POINTS = 100_000_000  # control points of the tensor-product form


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
        self._chain: list[list[tuple[KnotVector, Integers]]] = []
        for number, level in enumerate(hierarchy):
            self._chain.append([axis.knots_with(top, k, number) for axis, k in zip(axes, keys)])
            for d in (0, 1):
                index = np.unique(level.cells[level.refined, d])
                keys[d] = np.concatenate([keys[d], ((2 * index + 1) << (top - number)) >> 1])
        (self.kv_u, _), (self.kv_v, _) = self._chain[-1]
        if self.kv_u.dim * self.kv_v.dim > MOST_POINTS:
            raise ValueError(
                f"the tensor-product form needs {self.kv_u.dim} x {self.kv_v.dim} control points, more than "
                f"{MOST_POINTS}; "
                "use to_patches, or evaluate the THB surface itself"
            )
        self.supported = tuple(
            self._positions(level, level.functions[level.supported]) for level in hierarchy
        )
        self.active = tuple(self._positions(level, level.functions[level.active]) for level in hierarchy)
        self.dim = sum(len(rows) for rows in self.active)

    def knots(self, number: int) -> tuple[KnotVector, KnotVector]:
        """Return the KnotVectors of W_l."""
        (u, _), (v, _) = self._chain[number]
        return u, v

    def shape(self, number: int) -> tuple[int, int]:
        """Return the shape of the nets of W_l."""
        u, v = self.knots(number)
        return u.dim, v.dim

    def _positions(self, level: Level, functions: Integers) -> Integers:
        """Return where functions of a level whose supports lie in Omega_l sit in the flat net of W_l."""
        top = len(self._hierarchy) - 1
        index = []
        for d, axis in enumerate(self._axes):
            head = axis.knot_break(level.number, functions[:, d])
            rank = functions[:, d] - np.maximum(axis.first_knot(level.number, head), 0)
            keys = self._chain[level.number][d][1]
            index.append(np.searchsorted(keys, head << (top - level.number)) + rank)
        return locked(index[0] * self.shape(level.number)[1] + index[1])

    @cached_property
    def steps(self) -> list[tuple[csr_array, csr_array]]:
        """One-dimensional refinement operators (P_u, P_v) from W_(l-1) to W_l."""
        return [
            tuple(a.prolongation(b) for (a, _), (b, _) in zip(*pair))
            for pair in zip(self._chain, self._chain[1:])
        ]

    @cached_property
    def _steps_back(self) -> list[tuple[csr_array, csr_array]]:
        return [(pu.T.tocsr(), pv.T.tocsr()) for pu, pv in self.steps]

    def refined(self, number: int, net: Floats) -> Floats:
        """Return P_u net P_v^T, a net of W_(number - 1) in W_number."""
        pu, pv = self.steps[number - 1]
        return np.ascontiguousarray(tensor_apply(pu, pv, net))

    def refined_adjoint(self, number: int, net: Floats) -> Floats:
        """Return P_u^T net P_v, the transpose of `refined`."""
        pu, pv = self._steps_back[number - 1]
        return np.ascontiguousarray(tensor_apply(pu, pv, net))

    def coefficients(self, c: ArrayLike) -> Floats:
        """Return the tensor-product net of the spline with THB coefficients c.

        c : (dim,) or (dim, d).  Returns (n_u, n_v) or (n_u, n_v, d).
        """
        c = floats(c)
        if c.shape[:1] != (self.dim,) or c.ndim > 2:
            raise ValueError(f"coefficients must have shape ({self.dim},) or ({self.dim}, d), got {c.shape}")
        parts = np.split(c, np.cumsum([len(rows) for rows in self.active])[:-1])
        net = np.zeros((*self.shape(0), *c.shape[1:]))
        for number, (rows, part) in enumerate(zip(self.active, parts)):
            net = self.refined(number, net) if number else net
            net.reshape(-1, *c.shape[1:])[rows] = part
        return net

    def adjoint(self, net: ArrayLike) -> Floats:
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
