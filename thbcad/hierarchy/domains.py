"""Nested domains: which cells of every level are refined, and admissible refinement: few levels meet on every
cell.

Cells (i, j) of a level are packed into sorted 64-bit integers i n_v + j.

A hierarchy is admissible of class m when the truncated functions that act on a cell belong to at
most m successive levels.  The level of the cell does not count: a few fine cells carry coarse functions only.

What refinement keeps is stricter: on a cell of level l act functions of the levels l - m + 1 to l.  A
hierarchy that starts as a tensor-product space stays so when a cell Q of level l is refined after its
T-neighbourhood: the leaf cells of level l - m + 1 that meet the support extension of Q at level l - m + 2,
the union of the supports of the functions that act on Q there.

Source: A. Buffa, C. Giannelli, Adaptive isogeometric methods with hierarchical splines: error
estimator and convergence, M3AS 26 (2016); C. Bracco, C. Giannelli, R. Vazquez, Refinement
algorithms for adaptive isogeometric methods with hierarchical splines, Axioms 7 (2018).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Integers, require_integer, require_unmasked
from thbcad.hierarchy.levels import DyadicAxis

Cells = Mapping[int, ArrayLike] | ArrayLike  # {level: [(i, j), ...]}, or rows [level, i, j]

MAX_LEVEL = 24
MOST_CELLS = 10_000_000  # on level 0
NONE = np.zeros(0, dtype=np.int64)


class Domains:
    """Per level, the sorted keys of the refined cells.  Domains never change."""

    def __init__(self, axes: tuple[DyadicAxis, DyadicAxis], refined: tuple[Integers, ...] = ()) -> None:
        n_u, n_v = (axis.spans(0) for axis in axes)
        if n_u * n_v > MOST_CELLS:
            raise ValueError(f"a space must have at most {MOST_CELLS} cells on level 0, got {n_u} x {n_v}")
        self.axes = axes
        self._refined = refined

    @property
    def levels(self) -> int:
        """Number of levels that hold cells."""
        return len(self._refined) + 1

    def refined(self, level: int) -> Integers:
        """Return the keys of the refined cells of a level."""
        return self._refined[level] if level < len(self._refined) else NONE

    def pairs(self, level: int, keys: Integers) -> Integers:
        """Return the cells (i, j) of keys, (n, 2) int."""
        return np.stack(np.divmod(keys, self.axes[1].spans(level)), axis=1)

    def keys(self, level: int, pairs: Integers) -> Integers:
        """Return the keys of cells (i, j); refuse cells outside."""
        n_u, n_v = self._counts(level)
        bad = (pairs < 0).any(axis=1) | (pairs[:, 0] >= n_u) | (pairs[:, 1] >= n_v)
        if bad.any():
            i, j = pairs[bad][0]
            raise ValueError(f"cell ({i}, {j}) lies outside level {level}, which has {n_u} x {n_v} cells")
        return pairs[:, 0] * n_v + pairs[:, 1]

    def cells(self, level: int) -> Integers:
        """Return the keys of all cells of a level, refined or not."""
        if level == 0:
            return np.arange(self.axes[0].spans(0) * self.axes[1].spans(0))
        i, j = self.pairs(level - 1, self.refined(level - 1)).T
        keys = (2 * i[:, None] + [0, 0, 1, 1]) * self.axes[1].spans(level) + 2 * j[:, None] + [0, 1, 0, 1]
        return np.sort(keys, axis=None)

    def leaves(self, level: int) -> Integers:
        """Return the keys of the cells of a level that are not refined."""
        return np.setdiff1d(self.cells(level), self.refined(level), assume_unique=True)

    def refine(self, cells: Mapping[int, Integers]) -> Domains:
        """Return the domains in which the given leaf cells are refined too."""
        refined = list(self._refined)
        for level, pairs in sorted(cells.items()):
            keys = np.unique(self.keys(level, pairs))
            self._require_leaves(level, keys)
            self._counts(level + 1)
            if not all(axis.has_room(level, row) for axis, row in zip(self.axes, self.pairs(level, keys).T)):
                raise ValueError(f"level {level + 1} is too deep: neighbouring knots coincide in float64")
            if level == len(refined):
                refined.append(keys)
            else:
                refined[level] = np.union1d(refined[level], keys)
        return Domains(self.axes, tuple(refined))

    def coarsen(self, cells: Mapping[int, Integers]) -> Domains:
        """Return the domains in which the given refined cells are whole again."""
        refined = list(self._refined)
        for level, pairs in sorted(cells.items(), reverse=True):
            keys = np.unique(self.keys(level, pairs))
            self._require_parents_of_leaves(level, keys, refined)
            refined[level] = np.setdiff1d(refined[level], keys)
        while refined and len(refined[-1]) == 0:
            refined.pop()
        return Domains(self.axes, tuple(refined))

    def union(self, other: Domains) -> Domains:
        """Return the domains in which the refined cells of both are refined."""
        levels = range(max(self.levels, other.levels) - 1)
        return Domains(
            self.axes, tuple(np.union1d(self.refined(level), other.refined(level)) for level in levels)
        )

    def lacking(self, finer: Domains) -> tuple[int, int, int] | None:
        """Return the first cell (level, i, j) that is refined here and not in `finer`, None if there is
        none."""
        for level, keys in enumerate(self._refined):
            lacks = ~np.isin(keys, finer.refined(level), assume_unique=True)
            if lacks.any():
                i, j = self.pairs(level, keys[lacks][:1])[0].tolist()
                return level, i, j
        return None

    def _counts(self, level: int) -> tuple[int, int]:
        """Return the numbers of cells of a level in u and in v; refuse those whose keys overflow."""
        n_u, n_v = (axis.spans(level) for axis in self.axes)
        if n_u * n_v >= 1 << 63:
            raise ValueError(
                f"level {level} is too deep: its {n_u} x {n_v} cells cannot be counted in 64 bits"
            )
        return n_u, n_v

    def _parents(self, level: int, keys: Integers) -> Integers:
        """Return the keys on level - 1 of the cells that hold cells of a level."""
        i, j = self.pairs(level, keys).T
        result: Integers = (i >> 1) * self.axes[1].spans(level - 1) + (j >> 1)
        return result

    def _require_leaves(self, level: int, keys: Integers) -> None:
        if level:
            orphan = ~np.isin(self._parents(level, keys), self.refined(level - 1))
            self._refuse(level, keys[orphan], "does not exist: its parent is not refined")
        self._refuse(level, keys[np.isin(keys, self.refined(level))], "is refined already")

    def _require_parents_of_leaves(self, level: int, keys: Integers, refined: list[Integers]) -> None:
        whole = ~np.isin(keys, refined[level] if level < len(refined) else NONE)
        self._refuse(level, keys[whole], "is not refined")
        if level + 1 < len(refined):
            deep = np.isin(keys, self._parents(level + 1, refined[level + 1]))
            self._refuse(level, keys[deep], "has children that are refined; coarsen them first")

    def _refuse(self, level: int, keys: Integers, why: str) -> None:
        """Raise ValueError about the first of the keys, if there are any."""
        if len(keys):
            i, j = self.pairs(level, keys[:1])[0]
            raise ValueError(f"cell ({i}, {j}) of level {level} {why}")


def checked_cells(cells: Cells) -> dict[int, Integers]:
    """Return {level: (n, 2) int64} without empty entries."""
    checked = {}
    for level, pairs in (cells if isinstance(cells, Mapping) else _by_level(cells)).items():
        require_integer("level", level, 0, MAX_LEVEL - 1)
        require_unmasked(pairs)
        array = np.asarray(pairs)
        if array.size == 0:
            continue
        if array.ndim != 2 or array.shape[1] != 2 or array.dtype.kind not in "iu":
            raise ValueError(
                f"cells of level {level} must be pairs (i, j) of integers, got {array.dtype} of shape "
                f"{array.shape}"
            )
        if array.max() > np.iinfo(np.int64).max:
            raise ValueError(f"cells of level {level} must be pairs (i, j) below 2^63, got {array.max()}")
        checked[int(level)] = array.astype(np.int64)
    return checked


def _by_level(rows: ArrayLike) -> dict[int, Integers]:
    """Return rows [level, i, j] as {level: pairs (i, j)}."""
    require_unmasked(rows)
    array = np.asarray(rows)
    if array.size == 0:
        return {}
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iu":
        raise ValueError(
            "cells must be a mapping {level: [(i, j), ...]} or rows [level, i, j] of integers, got "
            f"{type(rows).__name__} of shape {array.shape} and type {array.dtype}"
        )
    return {level: array[array[:, 0] == level, 1:] for level in np.unique(array[:, 0]).tolist()}


def closure(domains: Domains, cells: Mapping[int, Integers], m: int) -> dict[int, Integers]:
    """Return the cells to refine together with `cells` so that class m is kept, {level: (n, 2) int}."""
    require_integer("the class of admissibility", m, 2)
    marked = dict(cells)
    for level in range(max(marked, default=0), m - 2, -1):
        coarse = level - m + 1
        if level not in marked or coarse < 0:
            continue
        parents = _neighbourhood(domains, level, marked[level], coarse)
        if len(parents):
            marked[coarse] = np.unique(np.concatenate([marked.get(coarse, parents), parents]), axis=0)
    return marked


def _neighbourhood(domains: Domains, level: int, pairs: Integers, coarse: int) -> Integers:
    """Return the leaf cells of level `coarse` in the T-neighbourhood of cells of a level, (n, 2) int."""
    ancestors = np.unique(pairs >> (level - coarse - 1), axis=0)
    ranges = [_parents_range(axis, coarse + 1, ancestors[:, d]) for d, axis in enumerate(domains.axes)]
    (low_u, steps_u), (low_v, steps_v) = ranges
    i = low_u[:, None, None] + np.minimum(np.arange(steps_u.max() + 1)[:, None], steps_u[:, None, None])
    j = low_v[:, None, None] + np.minimum(np.arange(steps_v.max() + 1), steps_v[:, None, None])
    i, j = np.broadcast_arrays(i, j)
    keys = np.unique(domains.keys(coarse, np.stack([i.ravel(), j.ravel()], axis=1)))
    return domains.pairs(coarse, np.intersect1d(keys, domains.leaves(coarse), assume_unique=True))


def _parents_range(axis: DyadicAxis, level: int, spans: Integers) -> tuple[Integers, Integers]:
    """Return (first, steps): the spans of level - 1 that meet the supports of all functions acting on each
    span of a level."""
    first = axis.acting(level, spans)
    low = axis.support(level, first)[0] >> 1
    high = (axis.support(level, first + axis.degree)[1] - 1) >> 1
    return low, high - low
