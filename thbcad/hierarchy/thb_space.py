"""Truncated hierarchical B-spline spaces over arbitrary nested cell domains.

Cells are those of `hierarchical_mesh`.  A function (level, i, j) *acts* where it is not zero; it is
*active* when its support lies in Omega_l but not in Omega_(l+1).  Degrees of freedom are ordered by
level, then i, then j.

Source: C. Giannelli, B. Juettler, H. Speleers, THB-splines: the truncated basis for
hierarchical splines, CAGD 29 (2012); thesis 3.36-3.39 with two-dimensional masks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, eye_array

from thbcad.checks import Floats, Integers, require_orders
from thbcad.hierarchy.hierarchical_mesh import HierarchicalMesh
from thbcad.hierarchy.level_nets import LocalBasis, Nets
from thbcad.hierarchy.levels import Level, make_level, numbered
from thbcad.hierarchy.mesh_picture import space_card
from thbcad.hierarchy.restriction import require_restored, restriction
from thbcad.hierarchy.tensor_embedding import Embedding
from thbcad.splines import csr_rows


@dataclass(frozen=True, eq=False)
class THBSpace(HierarchicalMesh):
    """The THB space over two knot vectors and a set of refined cells.

    ``THBSpace(kv_u, kv_v)`` is the tensor-product space; ``refine`` returns finer ones.
    Spaces never change.

    Raises ValueError : kv_u or kv_v that is no KnotVector; more than 10,000,000 cells on level 0.

    >>> kv = KnotVector.uniform(degree=3, spans=4)
    >>> space = THBSpace(kv, kv).refine({0: [(i, j) for i in (0, 1) for j in (0, 1)]})
    >>> space.levels, len(space.cells), space.dim
    (2, 28, 61)
    >>> space.collocation([0.1, 0.6], [0.3, 0.6]).sum(axis=1).round(15).tolist()  # truncated: they sum to one
    [1.0, 1.0]
    """

    def __repr__(self) -> str:
        degrees = (self.kv_u.degree, self.kv_v.degree)
        cells = len(self.cells)
        return f"THBSpace(degree {degrees}, {self.levels} levels, {cells} cells, dim {self.dim})"

    def _repr_html_(self) -> str:
        """Return a picture of the mesh and some numbers for notebooks."""
        return space_card(self, self.dim)

    @cached_property
    def functions(self) -> Integers:
        """Active functions, (dim, 3) int [level, i, j], in the order of the coefficients."""
        return numbered([level.functions[level.active] for level in self.hierarchy])

    @cached_property
    def dim(self) -> int:
        """Number of degrees of freedom."""
        return sum(int(level.active.sum()) for level in self.hierarchy)

    @cached_property
    def hierarchy(self) -> tuple[Level, ...]:
        """The levels as `Level` records, coarsest first."""
        return tuple(make_level(number, self.axes, *pair) for number, pair in enumerate(self.level_cells))

    @cached_property
    def nets(self) -> Nets:
        """The chain of the levels' coefficients."""
        return Nets(self.hierarchy)

    @cached_property
    def local_basis(self) -> LocalBasis:
        """The B-splines that act on every leaf cell."""
        return LocalBasis(self.hierarchy)

    @cached_property
    def embedding(self) -> Embedding:
        """The exact embedding into the smallest tensor-product spline space that holds this one.

        Raises ValueError : that space has more than 10^8 functions.
        """
        return Embedding(self._domains.axes, self.hierarchy)

    def greville(self) -> Floats:
        """Return the points of the control net, (dim, 2) float [u, v], in the order of the coefficients.

        The spline with these coefficients is the identity: sum_f greville_f T_f(u, v) = (u, v).  By
        preservation of coefficients the truncated function (level, i, j) has the Greville abscissae of the
        B-splines i and j of its level; level 0 alone has ``kv_u.greville()`` by ``kv_v.greville()``.
        """
        rows = []
        for level in self.hierarchy:
            by_axis = (axis.greville(level.number, row) for axis, row in zip(level.axes, level.distinct))
            rows.append(np.stack([g[rank[level.active]] for g, rank in zip(by_axis, level.ranks)], axis=1))
        return np.concatenate(rows)

    def prolongation(self, finer: THBSpace) -> csr_array[np.float64]:
        """Return P, csr_array (finer.dim, dim), with c_finer = P @ c for the same spline.

        The coefficient of an active function of the finer space is the coefficient that the
        spline has there in the level's own B-spline basis (preservation of coefficients).

        Raises ValueError : `finer` is not a refinement of this space.

        Source: C. Giannelli, B. Juettler, H. Speleers, Strongly stable bases for adaptively refined
        multilevel spline spaces, Adv. Comput. Math. 40 (2014).
        """
        self._require_within(finer)
        rows = [
            fine.find(coarse.functions[coarse.active])
            for coarse, fine in zip(self.hierarchy, finer.hierarchy)
        ]
        rows += [np.zeros(0, dtype=np.int64)] * (finer.levels - self.levels)
        return finer.nets.onto_active(finer.nets.operators(rows))

    def restriction(self, coarser: THBSpace) -> csr_array[np.float64]:
        """Return Q, csr_array (coarser.dim, dim), a local projection onto a coarser space: Q @ P == identity.

        P is ``coarser.prolongation(self)``.

        Raises ValueError : this space is not a refinement of `coarser`; or the knots are so unequal around
            the few whole cells of a function that float64 cannot restore its coefficient; or the norms of
            many levels multiply beyond 1e12.
        """
        self._require_same_knots("the coarser space", coarser)
        coarser._require_within(self)
        whole = self
        operator = eye_array(self.dim, format="csr")
        for level in range(self.levels - 2, -1, -1):
            extra = np.setdiff1d(whole._domains.refined(level), coarser._domains.refined(level))
            if len(extra):
                less = whole.coarsen({level: whole._domains.pairs(level, extra)})
                operator = restriction(less.hierarchy, whole.nets, level) @ operator
                require_restored(operator)
                whole = less
        return csr_array(operator)

    def hierarchical(self) -> csr_array[np.float64]:
        """Return H, csr_array (dim, dim): truncated coefficients H @ c of the spline with hierarchical
        coefficients c.

        The hierarchical basis (HB-splines) has the same functions, not truncated; it spans the same space.
        Source: R. Kraft, Adaptive and linearly independent multilevel B-splines (1997); thesis 3.3.3.
        """
        return self.nets.onto_active(self.nets.operators(self.nets.active, truncated=False))

    def wrapping(self) -> csr_array[np.float64]:
        """Return W, csr_array (dim, n) of ones, with C = W @ c of surfaces closed in u, in v or in both.

        Where knots are periodic, functions i and i + n_l of a level share a coefficient, n_l of them in a
        period: values and p - 1 derivatives go on across the seam, as of `KnotVector.wrapping`.

        Raises ValueError : no periodic knots; a function that is active on one side of a seam only.  Of the p
            cells of a level on either side, all must be refined or none.
        """
        knots = self.kv_u, self.kv_v
        if not any(kv.is_periodic for kv in knots):
            raise ValueError("a closed surface needs periodic knots in u or in v, see KnotVector.periodic")
        folded, copies = self.functions.copy(), np.ones(self.dim, dtype=np.int64)
        for d, kv in enumerate(knots, 1):
            if kv.is_periodic:
                new = kv.spans * ((1 << folded[:, 0]) - 1)
                period = kv.wrapping().shape[1] + new
                folded[:, d] %= period
                copies *= -((folded[:, d] - kv.dim - new) // period)
        classes, column, count = np.unique(folded, axis=0, return_inverse=True, return_counts=True)
        lone = count[column] < copies
        if lone.any():
            level, i, j = self.functions[lone][0]
            raise ValueError(
                f"function ({i}, {j}) of level {level} is active on one side of the seam only: refine all "
                f"{max(kv.degree for kv in knots)} nearest cells of either side, or none"
            )
        return csr_rows(np.ones(self.dim), column, len(classes))

    def extraction(self) -> csr_array[np.float64]:
        """Return the operator to local coefficients, csr_array (cells (p + 1)(q + 1), dim).

        On leaf cell k the spline is an ordinary B-spline of the cell's level; rows
        k (p + 1)(q + 1) ... hold its coefficients, the functions in u first, then in v.
        """
        return self.nets.operator[self.local_basis.blocks.ravel()]

    def incidence(self) -> csr_array[np.bool_]:
        """Return which functions act on which leaf cells, csr_array (cells, dim) of True.

        Row k holds the functions of cell k, column f (of ``.T``) the cells of function f.
        """
        e = self.extraction()
        size = self.local_basis.blocks[0].size
        entries = np.ones(e.nnz, dtype=bool), e.indices, e.indptr[::size]
        acting = csr_array(entries, shape=(e.shape[0] // size, self.dim))
        acting.sum_duplicates()
        return acting

    @cached_property
    def admissibility(self) -> int:
        """The least class m of admissibility: the functions on any leaf cell belong to at most m successive
        levels.

        It is the greatest (finest level - coarsest level + 1) of the functions on a cell.  A cell may be
        finer than all functions on it: its own level does not count.
        Source: A. Buffa, C. Giannelli, M3AS 26 (2016), definition of admissible meshes.
        """
        acting = self.incidence()
        levels = self.functions[acting.indices, 0]
        ends = [extreme.reduceat(levels, acting.indptr[:-1]) for extreme in (np.minimum, np.maximum)]
        return int((ends[1] - ends[0]).max()) + 1

    def collocation(
        self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)
    ) -> csr_array[np.float64]:
        """Return A[k, f] = d^(a+b)/du^a dv^b of function f at (u_k, v_k), csr_array (n, dim).

        Raises ValueError : points outside the domain or NaN, rows that do not broadcast, an order that is not
            a non-negative integer.
        """
        by_u, by_v, cell = self.local_values(u, v, derivative)
        values = by_u[:, :, None] * by_v[:, None, :]
        return csr_rows(values, self.local_basis.blocks[cell], sum(self.nets.sizes)) @ self.nets.operator

    def local_values(
        self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)
    ) -> tuple[Floats, Floats, Integers]:
        """Return the local B-splines in u, (n, p + 1), in v, (n, q + 1), and the leaf cell of every point,
        (n,) int.

        Raises ValueError : points outside the domain or NaN, rows that do not broadcast, an order that is not
            a non-negative integer.
        """
        u, v = self._rows(u, v)
        orders = require_orders(derivative)
        cell = self._quadtree.locate(u, v)
        return *self.local_basis.values(cell, u, v, orders), cell

    @cached_property
    def is_compact(self) -> bool:
        """Whether the tensor-product form is as good as the leaf cells, for evaluation.

        It must have no more coefficients than the cells hold together.  Its derivatives are differences over
        the finest spans, which costs a coarse cell in the rows or columns of fine ones a factor of at most
        2^(levels - 1) longest / shortest level-0 span: that must not exceed 256.
        """
        sizes = 1
        local = 1
        spread = 1.0
        for d, kv in enumerate((self.kv_u, self.kv_v)):
            sizes *= kv.dim + sum(len(np.unique(level.cells[level.refined, d])) for level in self.hierarchy)
            local *= kv.degree + 1
            spread = max(
                spread, float(np.diff(kv.breaks).max() / np.diff(kv.breaks).min()) * 2 ** (self.levels - 1)
            )
        return spread <= 256 and sizes <= len(self.cells) * local
