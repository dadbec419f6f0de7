"""Meshes of nested cells: how they are refined, and points on them.

A *cell* (level, i, j) is a product of non-empty knot spans.  Omega_l is the union of the
level-l cells that exist: Omega_0 is the whole domain, Omega_(l+1) the refined cells of
level l.  *Leaf cells* are the cells that are not refined; they tile the domain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import (
    Bools,
    Floats,
    Integers,
    coordinates,
    read_only,
    require_integer,
    require_number,
    require_type,
    require_unmasked,
    shown,
)
from thbcad.hierarchy.domains import MAX_LEVEL, Cells, Domains, checked_cells, closure
from thbcad.hierarchy.levels import DyadicAxis, numbered
from thbcad.hierarchy.quadtree import Quadtree
from thbcad.splines import KnotVector
from thbcad.values import Value

EVERYWHERE = (-np.inf, np.inf)
MOST_POINTS = 100  # of a Gauss rule: numpy's are tested up to there


@dataclass(frozen=True, eq=False)
class HierarchicalMesh(Value):
    """The mesh over two knot vectors and a set of refined cells.

    Meshes never change: `refine` returns finer ones, of the same class.

    Raises ValueError : kv_u or kv_v that is no KnotVector; more than 10,000,000 cells on level 0.
    """

    kv_u: KnotVector
    kv_v: KnotVector
    _given: Domains | None = field(default=None, kw_only=True)
    _domains: Domains = field(init=False)

    def __post_init__(self) -> None:
        for name, kv in (("kv_u", self.kv_u), ("kv_v", self.kv_v)):
            require_type(name, kv, KnotVector)
        domains = self._given
        if domains is None:
            domains = Domains((DyadicAxis(self.kv_u), DyadicAxis(self.kv_v)))
        object.__setattr__(self, "_domains", domains)

    def _content(self) -> tuple[Any, ...]:
        d = self._domains
        return self.kv_u, self.kv_v, *(d.refined(level) for level in range(self.levels - 1))

    @property
    def axes(self) -> tuple[DyadicAxis, DyadicAxis]:
        """Knots, spans and functions of every level, in u and in v."""
        return self._domains.axes

    @property
    def levels(self) -> int:
        """Number of levels that hold cells (1 for a tensor-product mesh)."""
        return self._domains.levels

    @property
    def refined(self) -> tuple[Integers, ...]:
        """Refined cells: one read-only (n, 2) int array of (i, j) for each level but the last."""
        d = self._domains
        return tuple(
            read_only(d.pairs(level, d.refined(level)), np.int64) for level in range(self.levels - 1)
        )

    @cached_property
    def level_cells(self) -> tuple[tuple[Integers, Bools], ...]:
        """All cells of every level, (n, 2) int in order of i, then j, and which are refined, (n,) bool."""
        d = self._domains
        levels = []
        for level in range(d.levels):
            keys = d.cells(level)
            refined = np.zeros(len(keys), dtype=bool)
            refined[np.searchsorted(keys, d.refined(level))] = True
            levels.append((d.pairs(level, keys), refined))
        return tuple(levels)

    @cached_property
    def cells(self) -> Integers:
        """Leaf cells, (n, 3) int [level, i, j], in order of level, i, j."""
        return numbered([cells[~refined] for cells, refined in self.level_cells])

    @cached_property
    def boxes(self) -> Floats:
        """Leaf cells as parameter intervals, (n, 4) float [u0, u1, v0, v1]: the hierarchical mesh."""
        rows = []
        for level, (cells, refined) in enumerate(self.level_cells):
            leaves = cells[~refined]
            rows.append(
                [axis.value(level, leaves[:, d] + k) for d, axis in enumerate(self.axes) for k in (0, 1)]
            )
        return read_only(np.concatenate(rows, axis=1).T)

    @cached_property
    def _quadtree(self) -> Quadtree:
        return Quadtree(self._domains.axes, self.cells)

    def refine(self, cells: Cells, admissible: int | None = None) -> Self:
        """Return the mesh or space in which the given leaf cells are cut into four.

        cells : rows of `cells`, (n, 3) int [level, i, j]; or a mask over `cells`, one bool for each, such as
            ``indicator > limit``; or {level: [(i, j), ...]}.  Repeats are harmless.
        admissible : a class m of 2 or more also refines the T-neighbourhoods of the cells.  A tensor-product
            space that is always refined so stays admissible of class m (see `THBSpace.admissibility`).

        Raises ValueError : a cell that does not exist or is refined already, a level out of range, a mask of
            another length, cells too short for float64.
        """
        marked = checked_cells(self._rows_of_mask(cells))
        domains = self._domains.refine(marked)
        if admissible is not None:
            domains = self._domains.refine(closure(self._domains, marked, admissible))
        return replace(self, _given=domains)

    def refine_box(
        self, level: int, u: tuple[float, float], v: tuple[float, float], admissible: int | None = None
    ) -> Self:
        """Return the mesh or space in which all cells that meet a box are of a level or finer.

        Leaf cells of level 0 that meet the box [u0, u1] x [v0, v1] are refined, then those of level 1, and so
        on up to level - 1.  A cell meets the box when its interior does: a common edge is not enough.  So the
        box, rounded outwards to cells of level - 1, is filled with cells of this level or finer.  Children
        beside the box keep their level.

        u, v : the sides; they may reach beyond the domain, to infinity too.
        admissible : as in `refine`.

        Raises ValueError : a level that is no whole number from 0 to MAX_LEVEL, sides that do not increase, a
            box outside the domain, cells too short for float64.
        """
        require_integer("level", level, 0, MAX_LEVEL)
        (u0, u1), (v0, v1) = _side("u", u, self.kv_u), _side("v", v, self.kv_v)
        mesh = self
        for number in range(level):
            left, right, low, high = mesh.boxes.T
            meets = (left < u1) & (right > u0) & (low < v1) & (high > v0)
            mesh = mesh.refine(meets & (mesh.cells[:, 0] == number), admissible)
        return mesh

    def uniform(self, level: int) -> Self:
        """Return the mesh or space in which all cells that are coarser than a level are cut down to it.

        Raises ValueError : a level that is no whole number from 0 to MAX_LEVEL, cells too short for float64.
        """
        return self.refine_box(level, EVERYWHERE, EVERYWHERE)

    def coarsen(self, cells: Cells) -> Self:
        """Return the mesh or space in which the given refined cells are whole again: the inverse of `refine`.

        cells : rows [level, i, j] or {level: [(i, j), ...]}, the cells that were passed to `refine`.

        Raises ValueError : a cell that is not refined, or whose children are.
        """
        return replace(self, _given=self._domains.coarsen(checked_cells(cells)))

    def locate(self, u: ArrayLike, v: ArrayLike) -> Integers:
        """Return for each point (u_k, v_k) the index of its leaf cell in `cells`, (n,) int.

        Raises ValueError : points outside the domain or NaN, rows that do not broadcast.
        """
        return self._quadtree.locate(*self._rows(u, v))

    def quadrature(self, n: int | tuple[int, int] | None = None) -> tuple[Floats, Floats, Floats, Integers]:
        """Return (u, v, weights, cell), (m,) each: Gauss quadrature with n x n points on every leaf cell.

        The integral of f is sum_k weights_k f(u_k, v_k), exact on every cell for polynomials of degree
        2 n - 1 in u and in v.  Point k lies in leaf cell ``cell[k]``; the points of a cell follow each other.

        n : an integer, or one for u and one for v; by default degree + 1, which is exact for products of two
            splines of the space, and for products of their derivatives.

        Raises ValueError : n that is no integer from 1 to 100, nor two of them.
        """
        counts = (self.kv_u.degree + 1, self.kv_v.degree + 1) if n is None else n
        pair = counts if isinstance(counts, Sequence) and len(counts) == 2 else (counts, counts)
        for count in pair:
            require_integer("the number of points", count, 1, MOST_POINTS)
        (x, by_u), (y, by_v) = (np.polynomial.legendre.leggauss(int(count)) for count in pair)
        u, v = self.cell_points((1 + x) / 2, (1 + y) / 2)
        u0, u1, v0, v1 = self.boxes.T
        weights = np.outer((u1 - u0) * (v1 - v0), np.outer(by_u, by_v) / 4)
        cell = np.repeat(np.arange(len(u)), u.shape[1])
        return u.ravel(), v.ravel(), weights.ravel(), cell

    def cell_points(self, shares_u: Floats, shares_v: Floats) -> tuple[Floats, Floats]:
        """Return (u, v), each (cells, n_u n_v): points at fractions of every leaf cell's sides, u first, then
        v."""
        u0, u1, v0, v1 = self.boxes.T[:, :, None]
        u, v = u0 + (u1 - u0) * shares_u, v0 + (v1 - v0) * shares_v
        return np.repeat(u, len(shares_v), axis=1), np.tile(v, len(shares_u))

    def _rows_of_mask(self, cells: Cells) -> Cells:
        """Return the rows that a mask over the leaf cells chooses; other ways to name cells as they are."""
        if isinstance(cells, Mapping):
            return cells
        require_unmasked(cells)
        mask = np.asarray(cells)
        if mask.dtype != bool:
            return cells
        count = len(self.cells)
        if mask.shape != (count,):
            raise ValueError(
                f"a mask must hold a bool for each of the {count} leaf cells, got shape {mask.shape}"
            )
        rows: Integers = self.cells[mask]
        return rows

    def _require_same_knots(self, name: str, other: object) -> None:
        wanted = f"{name} must be a {type(self).__name__} over the same two knot vectors"
        if not isinstance(other, type(self)):
            raise ValueError(f"{wanted}, got {type(other).__name__}")
        for side in ("kv_u", "kv_v"):
            if getattr(self, side) != getattr(other, side):
                raise ValueError(f"{wanted}, got one with another {side}")

    def _require_within(self, finer: Self) -> None:
        """Raise ValueError unless the other mesh is a refinement of this one."""
        self._require_same_knots("the finer space", finer)
        lacking = self._domains.lacking(finer._domains)
        if lacking:
            level, i, j = lacking
            raise ValueError(
                "the finer space is not a refinement of the coarser one: "
                f"cell ({i}, {j}) of level {level} is refined in the coarser one only"
            )

    def _rows(self, u: ArrayLike, v: ArrayLike) -> tuple[Floats, Floats]:
        """Return points as two rows, (n,) each."""
        u, v = coordinates(u=(u, self.kv_u.domain), v=(v, self.kv_v.domain))
        if u.ndim > 1:
            raise ValueError(f"u and v must be rows of points, got shape {u.shape}")
        return np.atleast_1d(u), np.atleast_1d(v)


Mesh = TypeVar("Mesh", bound=HierarchicalMesh)


def common_refinement(a: Mesh, b: Mesh) -> Mesh:
    """Return the coarsest space that is a refinement of both: a cell is refined where it is in a or in b.

    Raises ValueError : a that is no THBSpace, b that is none over the same two knot vectors.
    """
    require_type("a", a, HierarchicalMesh)
    a._require_same_knots("b", b)
    return replace(a, _given=a._domains.union(b._domains))


def _side(name: str, side: tuple[float, float], kv: KnotVector) -> tuple[float, float]:
    """Return the ends of a side of a box as floats."""
    if not isinstance(side, Sequence | np.ndarray) or len(side) != 2:
        raise ValueError(f"{name} must be a pair (start, stop) of numbers, got {shown(side)}")
    for end in side:
        require_number(name, end)
    start, stop = float(side[0]), float(side[1])
    if not (start < stop and start < kv.stop and stop > kv.start):
        raise ValueError(
            f"{name} must increase and meet the domain [{kv.start}, {kv.stop}], got ({start}, {stop})"
        )
    return start, stop
