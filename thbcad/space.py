"""Truncated hierarchical B-spline spaces over arbitrary nested cell domains.

Vocabulary
----------
A *cell* (level, i, j) is a product of non-empty knot spans.  Omega_l is the union of the
level-l cells that exist: Omega_0 is the whole domain, Omega_(l+1) the refined cells of
level l.  *Leaf cells* are the cells that are not refined.  A function (level, i, j) is
*active* when its support lies in Omega_l but not in Omega_(l+1).  Degrees of freedom are
ordered by level, then i, then j.

Cells are stored as sorted integers, masks in compressed coordinates: only the rows and
columns in which a level has cells, never the full grid of a level.

Source: C. Giannelli, B. Juettler, H. Speleers, THB-splines: the truncated basis for
hierarchical splines, CAGD 29 (2012); thesis 3.36-3.39 with two-dimensional masks.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, eye_array

from thbcad import transfer
from thbcad.bspline import KnotVector, csr_rows, read_only
from thbcad.embedding import Embedding
from thbcad.extraction import extraction
from thbcad.hierarchy import DyadicAxis, Level

MAX_LEVEL = 24


class THBSpace:
    """The THB space over two knot vectors and a set of refined cells.

    ``THBSpace(kv_u, kv_v)`` is the tensor-product space; ``refine`` returns finer ones.
    Spaces never change.
    """

    def __init__(self, kv_u: KnotVector, kv_v: KnotVector) -> None:
        for name, kv in (("kv_u", kv_u), ("kv_v", kv_v)):
            if not isinstance(kv, KnotVector):
                raise ValueError(f"{name} must be a KnotVector, got {type(kv).__name__}")
        self.kv_u, self.kv_v = kv_u, kv_v
        self.axes = DyadicAxis(kv_u), DyadicAxis(kv_v)
        self._refined: tuple[NDArray[np.int64], ...] = ()  # per level: sorted keys of refined cells

    @property
    def levels(self) -> int:
        """Number of levels that hold cells (1 for a tensor-product space)."""
        return len(self._refined) + 1

    @property
    def refined(self) -> tuple[NDArray[np.int64], ...]:
        """Refined cells: one read-only (n, 2) int array of (i, j) for each level but the last."""
        pairs = (self._split(level, keys) for level, keys in enumerate(self._refined))
        return tuple(read_only(np.stack(p, axis=1), np.int64) for p in pairs)

    @cached_property
    def cells(self) -> NDArray[np.int64]:
        """Leaf cells, (n, 3) int [level, i, j], in order of level, i, j."""
        rows = []
        for number, level in enumerate(self.hierarchy):
            a, b = np.nonzero(level.leaves)
            rows.append(_numbered(number, np.stack([level.rows[a], level.columns[b]], axis=1)))
        return read_only(np.concatenate(rows), np.int64)

    @cached_property
    def functions(self) -> NDArray[np.int64]:
        """Active functions, (dim, 3) int [level, i, j], in the order of the coefficients."""
        rows = [_numbered(number, level.functions) for number, level in enumerate(self.hierarchy)]
        return read_only(np.concatenate(rows), np.int64)

    @cached_property
    def dim(self) -> int:
        """Number of degrees of freedom."""
        return sum(int(level.active.sum()) for level in self.hierarchy)

    @cached_property
    def embedding(self) -> Embedding:
        """The exact embedding into the smallest tensor-product spline space that holds this one."""
        return Embedding(self.axes, self.hierarchy)

    def refine(self, cells: Mapping[int, ArrayLike]) -> THBSpace:
        """Return the space in which the given leaf cells are cut into four.

        cells : {level: [(i, j), ...]}; repeats are harmless.

        Raises
        ------
        ValueError : a cell that does not exist or is refined already, a level out of range.
        """
        refined = list(self._refined)
        for level, pairs in sorted(_checked_cells(cells).items()):
            keys = np.unique(self._keys(level, pairs))
            self._require_leaves(level, keys)
            if level == len(refined):
                refined.append(keys)
            else:
                refined[level] = np.union1d(refined[level], keys)
        space = THBSpace(self.kv_u, self.kv_v)
        space._refined = tuple(refined)
        return space

    def coarsen(self, cells: Mapping[int, ArrayLike]) -> THBSpace:
        """Return the space in which the given refined cells are whole again: the inverse of `refine`.

        cells : {level: [(i, j), ...]}, the cells that were passed to `refine`.

        Raises
        ------
        ValueError : a cell that is not refined, or whose children are.
        """
        refined = list(self._refined)
        for level, pairs in sorted(_checked_cells(cells).items(), reverse=True):
            keys = np.unique(self._keys(level, pairs))
            self._require_parents_of_leaves(level, keys, refined)
            refined[level] = np.setdiff1d(refined[level], keys)
        while refined and len(refined[-1]) == 0:
            refined.pop()
        space = THBSpace(self.kv_u, self.kv_v)
        space._refined = tuple(refined)
        return space

    def locate(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.int64]:
        """Return for each point (u_k, v_k) the index of its leaf cell in `cells`, (n,) int."""
        u, v = self._points(u, v)
        found = np.full(len(u), -1)
        offset = 0
        for number, level in enumerate(self.hierarchy):
            leaves = level.leaves
            order = offset - 1 + np.cumsum(leaves.ravel()).reshape(leaves.shape)
            a, in_a = _position(level.rows, self.axes[0].span_at(number, u))
            b, in_b = _position(level.columns, self.axes[1].span_at(number, v))
            here = in_a & in_b & leaves[a, b]
            found[here] = order[a[here], b[here]]
            offset += int(leaves.sum())
        return found

    def prolongation(self, finer: THBSpace) -> csr_array:
        """Return P, csr_array (finer.dim, dim), with c_finer = P @ c for the same spline.

        The coefficient of an active function of the finer space is the coefficient that the
        spline has there in the level's own B-spline basis (preservation of coefficients).

        Raises
        ------
        ValueError : `finer` is not a refinement of this space.
        """
        self._require_nested(finer)
        return transfer.prolongation(self.hierarchy, finer.embedding)

    def restriction(self, coarser: THBSpace) -> csr_array:
        """Return Q, csr_array (coarser.dim, dim), a local projection onto a coarser space: Q @ P == identity.

        P is ``coarser.prolongation(self)``.

        Raises
        ------
        ValueError : this space is not a refinement of `coarser`.
        """
        if not isinstance(coarser, THBSpace):
            raise ValueError("the coarser space must be a THBSpace over the same two knot vectors")
        coarser._require_nested(self)
        whole, operator = self, eye_array(self.dim, format="csr")
        for level in range(self.levels - 2, -1, -1):
            held = coarser._refined[level] if level < len(coarser._refined) else np.zeros(0, dtype=np.int64)
            extra = np.setdiff1d(whole._refined[level], held)
            if len(extra):
                less = whole.coarsen({level: np.stack(self._split(level, extra), axis=1)})
                operator = transfer.restriction(less.hierarchy, whole.hierarchy, whole.embedding, self.axes, level) @ operator
                whole = less
        return csr_array(operator)

    def extraction(self) -> csr_array:
        """Return the operator to local coefficients, csr_array (cells (p + 1)(q + 1), dim).

        On leaf cell k the spline is an ordinary B-spline of the cell's level; rows
        k (p + 1)(q + 1) ... hold its coefficients, the functions in u first, then in v.
        """
        return extraction(self.hierarchy, self.embedding, self.axes)

    def collocation(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> csr_array:
        """Return A[k, f] = d^(a+b)/du^a dv^b of function f at (u_k, v_k), csr_array (n, dim)."""
        u, v = self._points(u, v)
        e = self.embedding
        first_u, values_u = e.kv_u.basis(u, derivative[0])
        first_v, values_v = e.kv_v.basis(v, derivative[1])
        rows = first_u[:, None] + np.arange(values_u.shape[1])
        columns = first_v[:, None] + np.arange(values_v.shape[1])
        indices = rows[:, :, None] * e.kv_v.dim + columns[:, None, :]
        values = values_u[:, :, None] * values_v[:, None, :]
        return csr_rows(values, indices, e.kv_u.dim * e.kv_v.dim) @ e.operator

    @cached_property
    def hierarchy(self) -> tuple[Level, ...]:
        """The levels as `Level` records, coarsest first."""
        levels = []
        for number in range(self.levels):
            rows, columns, inside = self._existing(number)
            refined = np.zeros_like(inside)
            if number < len(self._refined):
                i, j = self._split(number, self._refined[number])
                refined[np.searchsorted(rows, i), np.searchsorted(columns, j)] = True
            levels.append(Level(rows, columns, inside, refined, *self._functions(number, rows, columns, inside, refined)))
        return tuple(levels)

    def _existing(self, number: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Return the compressed coordinates and the mask of Omega at a level."""
        if number == 0:
            shape = tuple(axis.spans(0) for axis in self.axes)
            return np.arange(shape[0]), np.arange(shape[1]), np.ones(shape, dtype=bool)
        i, j = self._split(number - 1, self._refined[number - 1])
        parents_u, parents_v = np.unique(i), np.unique(j)
        mask = np.zeros((len(parents_u), len(parents_v)), dtype=bool)
        mask[np.searchsorted(parents_u, i), np.searchsorted(parents_v, j)] = True
        rows, columns = ((2 * p[:, None] + np.arange(2)).ravel() for p in (parents_u, parents_v))
        return rows, columns, mask.repeat(2, axis=0).repeat(2, axis=1)

    def _functions(
        self, number: int, rows: NDArray[np.int64], columns: NDArray[np.int64], inside: NDArray[np.bool_], refined: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Return the functions supported in Omega_l, their heads, and whether they are active."""
        fu, start_u, length_u = self.axes[0].functions_within(number, rows)
        fv, start_v, length_v = self.axes[1].functions_within(number, columns)
        area = length_u[:, None] * length_v

        def covered(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
            table = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1), dtype=np.int64)
            table[1:, 1:] = mask.cumsum(axis=0).cumsum(axis=1)
            by_u = table[start_u + length_u] - table[start_u]
            return by_u[:, start_v + length_v] - by_u[:, start_v] == area

        a, b = np.nonzero(covered(inside))
        supported = np.stack([fu[a], fv[b]], axis=1)
        heads = np.stack([rows[start_u[a]], columns[start_v[b]]], axis=1)
        return supported, heads, ~covered(refined)[a, b]

    def _keys(self, level: int, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
        """Pack cells (i, j) of a level into sortable integers; refuse cells outside."""
        n_u, n_v = (axis.spans(level) for axis in self.axes)
        if n_u * n_v >= 1 << 62:
            raise ValueError(f"level {level} is too deep: its {n_u} x {n_v} cells cannot be counted in 64 bits")
        bad = (pairs < 0).any(axis=1) | (pairs[:, 0] >= n_u) | (pairs[:, 1] >= n_v)
        if bad.any():
            i, j = pairs[bad][0]
            raise ValueError(f"cell ({i}, {j}) lies outside level {level}, which has {n_u} x {n_v} cells")
        return pairs[:, 0] * n_v + pairs[:, 1]

    def _split(self, level: int, keys: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return np.divmod(keys, self.axes[1].spans(level))

    def _require_leaves(self, level: int, keys: NDArray[np.int64]) -> None:
        refined = (*self._refined, np.zeros(0, dtype=np.int64))
        i, j = self._split(level, keys)
        if level > len(self._refined):
            orphan = np.ones(len(keys), dtype=bool)
        elif level == 0:
            orphan = np.zeros(len(keys), dtype=bool)
        else:
            orphan = ~np.isin((i >> 1) * self.axes[1].spans(level - 1) + (j >> 1), refined[level - 1])
        if orphan.any():
            raise ValueError(f"cell ({i[orphan][0]}, {j[orphan][0]}) of level {level} does not exist: its parent is not refined")
        twice = np.isin(keys, refined[level])
        if twice.any():
            raise ValueError(f"cell ({i[twice][0]}, {j[twice][0]}) of level {level} is refined already")

    def _require_parents_of_leaves(self, level: int, keys: NDArray[np.int64], refined: list[NDArray[np.int64]]) -> None:
        known = refined[level] if level < len(refined) else np.zeros(0, dtype=np.int64)
        whole = ~np.isin(keys, known)
        if whole.any():
            i, j = self._split(level, keys[whole][:1])
            raise ValueError(f"cell ({i[0]}, {j[0]}) of level {level} is not refined")
        if level + 1 < len(refined):
            i, j = self._split(level + 1, refined[level + 1])
            parents = (i >> 1) * self.axes[1].spans(level) + (j >> 1)
            deep = np.isin(keys, parents)
            if deep.any():
                i, j = self._split(level, keys[deep][:1])
                raise ValueError(f"cell ({i[0]}, {j[0]}) of level {level} has children that are refined; coarsen them first")

    def _require_nested(self, finer: THBSpace) -> None:
        if not isinstance(finer, THBSpace) or not all(
            a.degree == b.degree and np.array_equal(a.knots, b.knots) for a, b in ((self.kv_u, finer.kv_u), (self.kv_v, finer.kv_v))
        ):
            raise ValueError("the finer space must be a THBSpace over the same two knot vectors")
        if finer.levels < self.levels or not all(np.isin(a, b).all() for a, b in zip(self._refined, finer._refined)):
            raise ValueError("the other space is not a refinement of this one: it lacks some refined cells")

    def _points(self, u: ArrayLike, v: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        u, v = (np.atleast_1d(np.asarray(x, dtype=np.float64)) for x in (u, v))
        if u.shape != v.shape or u.ndim != 1:
            raise ValueError(f"u and v must be two rows of equal length, got shapes {u.shape} and {v.shape}")
        self.kv_u.require_inside(u)
        self.kv_v.require_inside(v)
        return u, v


def _numbered(level: int, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.column_stack([np.full(len(pairs), level), pairs])


def _position(sorted_values: NDArray[np.int64], wanted: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return (index, found) of `wanted` in `sorted_values`."""
    index = np.minimum(np.searchsorted(sorted_values, wanted), len(sorted_values) - 1)
    return index, sorted_values[index] == wanted


def _checked_cells(cells: Mapping[int, ArrayLike]) -> dict[int, NDArray[np.int64]]:
    """Return {level: (n, 2) int64} without empty entries."""
    checked = {}
    for level, pairs in cells.items():
        if isinstance(level, bool) or not isinstance(level, (int, np.integer)) or not 0 <= level < MAX_LEVEL:
            raise ValueError(f"level must be an integer from 0 to {MAX_LEVEL - 1}, got {level!r}")
        array = np.asarray(pairs)
        if array.size == 0:
            continue
        if array.ndim != 2 or array.shape[1] != 2 or array.dtype.kind not in "iu":
            raise ValueError(f"cells of level {level} must be pairs (i, j) of integers, got {array.dtype} of shape {array.shape}")
        checked[int(level)] = array.astype(np.int64)
    return checked
