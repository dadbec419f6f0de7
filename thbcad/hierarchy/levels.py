"""Integer bookkeeping of dyadic refinement.

At level l every non-empty span of the first knot vector is cut into 2^l equal parts.  Breaks
and spans are counted in integers; break b of level l stands for the rational position
b / 2^l in the row of level-0 breaks, so that no rounding accumulates with the level.
Old knots keep their multiplicity, new ones are simple.  Spans outside the domain, of knots that are
not clamped, are cut, too: their breaks have numbers below 0 or above those of the domain, and of
every level p knots count on either side.

A level holds its cells and the functions that act on them, as sorted integers: cost and
storage are in proportion to the cells, wherever they lie.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from thbcad.checks import EPS, Bools, Floats, Integers, locked, read_only
from thbcad.splines import KnotVector, blossom, greville_abscissae


class DyadicAxis:
    """Knots, spans and functions of all levels above one knot vector, by arithmetic."""

    def __init__(self, knot_vector: KnotVector) -> None:
        self.knot_vector = knot_vector
        self.degree = knot_vector.degree
        self.spans0 = knot_vector.spans
        row, multiplicity = np.unique(knot_vector.knots, return_counts=True)
        self._row = row
        self._origin = origin = int(np.searchsorted(row, knot_vector.start))  # where break 0 is in the row
        self._multiplicity = multiplicity
        surplus = np.r_[0, np.cumsum(multiplicity - 1)]
        self._surplus = surplus - surplus[origin + 1] + self.degree  # the last knot at break 0 is knot p
        # the largest number in units of the shortest span
        self.roughness = 1 + float(np.abs(row).max() / np.diff(row).min())

    def spans(self, level: int) -> int:
        """Return the number of non-empty spans of a level."""
        return self.spans0 << level

    def value(self, level: int, breaks: Integers) -> Floats:
        """Return the positions of breaks of a level, float."""
        row, last = self._row, len(self._row) - 1 - self._origin
        whole = np.minimum(breaks >> level, last - 1)
        fraction = (breaks - (whole << level)) / float(1 << level)
        low, high = row[whole + self._origin], row[whole + self._origin + 1]
        result: Floats = np.where(breaks == last << level, row[-1], low + (high - low) * fraction)
        return result

    def multiplicity(self, level: int, breaks: Integers) -> Integers:
        """Return how often each break occurs in the knot vector of a level."""
        old = (breaks & ((1 << level) - 1)) == 0
        return np.where(old, self._multiplicity[(breaks >> level) + self._origin], 1)

    def first_knot(self, level: int, breaks: Integers) -> Integers:
        """Return the index of the first knot at each break of a level."""
        whole = -((-breaks) >> level)
        result: Integers = breaks + self._surplus[whole + self._origin]
        return result

    def knot_break(self, level: int, knots: Integers) -> Integers:
        """Return the break of a level at which each knot of the level sits, given the knots' indices."""
        breaks = self._breaks(level)
        starts = breaks + self._surplus[:-1]
        whole = np.searchsorted(starts, knots, side="right") - 1
        result: Integers = breaks[whole] + np.maximum(
            knots - starts[whole] - self._multiplicity[whole] + 1, 0
        )
        return result

    def _breaks(self, level: int) -> Integers:
        """Return the level-0 breaks in breaks of a level, those outside the domain too."""
        return (np.arange(len(self._row)) - self._origin) << level

    def knots(self, level: int, index: Integers) -> Floats:
        """Return knots of a level by their indices."""
        return self.value(level, self.knot_break(level, index))

    def greville(self, level: int, functions: Integers) -> Floats:
        """Return the Greville abscissae of functions of a level."""
        knots = self.knots(level, functions[:, None] + np.arange(self.degree + 2))
        return greville_abscissae(knots, self.degree)[:, 0]

    def acting(self, level: int, spans: Integers) -> Integers:
        """Return the first function of a level that acts on each span; the p after it do too."""
        return self.first_knot(level, spans) + self.multiplicity(level, spans) - 1 - self.degree

    def support(self, level: int, functions: Integers) -> tuple[Integers, Integers]:
        """Return the breaks of the domain between which functions of a level are positive."""
        head, tail = (self.knot_break(level, functions + k) for k in (0, self.degree + 1))
        return np.maximum(head, 0), np.minimum(tail, self.spans(level))

    def knots_around(self, level: int, spans: Integers) -> Floats:
        """Return the p knots of a level on either side of the inner of each span, (2p, n)."""
        offsets = np.arange(1, 2 * self.degree + 1)
        return self.knots(level, self.acting(level, spans) + offsets[:, None])

    def two_scale(self, level: int, functions: Integers, coarser: Integers) -> csr_array:
        """Return the rows `functions` and columns `coarser` of the refinement operator from level - 1 to a
        level.

        Row j holds the polar form at the knots t_(j+1) ... t_(j+p) of the finer level (thesis 3.30-3.35).
        """
        p = self.degree
        spans = np.maximum(self.knot_break(level, functions), 0) >> 1
        arguments = self.knots(level, functions[:, None] + np.arange(1, p + 1))
        weights = blossom(self.knots_around(level - 1, spans), arguments)
        wanted = self.acting(level - 1, spans)[:, None] + np.arange(p + 1)
        # B-splines of the finer level build up those coarser ones whose supports hold theirs
        holds = (self._finer_index(level, wanted) <= functions[:, None]) & (
            self._finer_index(level, wanted + p + 1) >= functions[:, None] + p + 1
        )
        rows, k = np.nonzero(holds)
        columns = np.searchsorted(coarser, wanted[rows, k])
        return csr_array((weights[rows, k], (rows, columns)), shape=(len(functions), len(coarser)))

    def _finer_index(self, level: int, knots: Integers) -> Integers:
        """Return the indices in a level of knots of the level before."""
        breaks = self.knot_break(level - 1, knots)
        return self.first_knot(level, 2 * breaks) + knots - self.first_knot(level - 1, breaks)

    def has_room(self, level: int, spans: Integers) -> bool:
        """Return whether the middles of spans of a level differ from their ends in float64."""
        if 4 * EPS * self.roughness * (2 << level) < 1:
            return True
        low, middle, high = (self.value(level + 1, 2 * np.unique(spans) + k) for k in range(3))
        return bool(((low < middle) & (middle < high)).all())

    def knots_with(self, level: int, keys: Integers, outer: int = 0) -> tuple[KnotVector, Integers]:
        """Return the level-0 knots of the domain together with simple knots at the breaks `keys` of a level,
        and all of them as breaks.

        outer : the level of the knots outside the domain
        """
        last = self.first_knot(outer, np.array(self.spans(outer)))
        ends = np.r_[np.arange(self.degree + 1), last + np.arange(self.degree + 1)]
        old = np.repeat(self._breaks(level), self._multiplicity)
        inner = old[(old > 0) & (old < self.spans(level))]
        all_keys = np.sort(np.r_[self.knot_break(outer, ends) << (level - outer), inner, keys])
        return KnotVector(self.degree, self.value(level, all_keys)), all_keys

    def span_at(self, level: int, u: Floats) -> Integers:
        """Return for parameters u inside the domain the span of a level that contains them."""
        row = self.knot_vector.breaks
        whole = np.clip(np.searchsorted(row, u, "right") - 1, 0, self.spans0 - 1)
        parts = (u - row[whole]) / (row[whole + 1] - row[whole]) * (1 << level)
        span = (whole << level) + np.minimum(parts.astype(np.int64), (1 << level) - 1)
        # near a break the quotient may round to its other side: the breaks themselves settle it
        near = np.flatnonzero(np.abs(parts - np.rint(parts)) <= 8 * EPS * self.roughness * (1 << level))
        if len(near):
            u = u[near]
            settled = span[near]
            settled -= u < self.value(level, settled)
            settled += (settled + 1 < self.spans(level)) & (
                u >= self.value(level, np.minimum(settled + 1, self.spans(level)))
            )
            span[near] = np.maximum(settled, 0)
        return span


@dataclass(frozen=True, eq=False)
class Level:
    """One level: the cells of Omega_l and the functions that act on them, read-only rows, all in order of i,
    then j.

    cells : (n, 2) int, cells (i, j) of Omega_l
    refined : (n,) bool, the cell is refined
    distinct : the different i and the different j of the acting functions, two sorted rows
    keys : (m,) int, sorted; a len(distinct[1]) + b stands for the function (distinct[0][a], distinct[1][b])
    supported : (m,) bool, the support of the function lies in Omega_l
    active : (m,) bool, and not in Omega_(l+1)
    """

    number: int
    axes: tuple[DyadicAxis, DyadicAxis]
    cells: Integers
    refined: Bools
    distinct: tuple[Integers, Integers]
    keys: Integers
    supported: Bools
    active: Bools

    @property
    def leaves(self) -> Integers:
        """Cells that are not refined, (k, 2) int."""
        return locked(self.cells[~self.refined])

    @cached_property
    def ranks(self) -> tuple[Integers, Integers]:
        """Positions (a, b) of the acting functions in `distinct`, two (m,) int."""
        a, b = np.divmod(self.keys, len(self.distinct[1]))
        return locked(a), locked(b)

    @cached_property
    def functions(self) -> Integers:
        """Acting functions (i, j), (m, 2) int."""
        return locked(np.stack([row[rank] for row, rank in zip(self.distinct, self.ranks)], axis=1))

    def find(self, functions: Integers) -> Integers:
        """Return the positions of functions (i, j) among the acting ones, -1 where they do not act; functions
        : (..., 2) int."""
        ranks, known = zip(*(_position(row, functions[..., d]) for d, row in enumerate(self.distinct)))
        at, held = _position(self.keys, ranks[0] * len(self.distinct[1]) + ranks[1])
        return np.where(held & known[0] & known[1], at, -1)

    def blocks(self, cells: Integers) -> Integers:
        """Return the positions of the functions that act on each cell of the level, (n, p + 1, q + 1) int."""
        first_u, first_v = (axis.acting(self.number, cells[:, d]) for d, axis in enumerate(self.axes))
        rows = first_u[:, None] + np.arange(self.axes[0].degree + 1)
        heads = self.find(np.stack(np.broadcast_arrays(rows, first_v[:, None]), axis=-1))
        return heads[:, :, None] + np.arange(self.axes[1].degree + 1)


def make_level(number: int, axes: tuple[DyadicAxis, DyadicAxis], cells: Integers, refined: Bools) -> Level:
    """Return the level with these cells.

    With incidences B between spans and functions, B_u^T M B_v counts the cells in the support
    of every function; one product counts all cells and, times 256, the refined ones.
    """
    spans_u, row = np.unique(cells[:, 0], return_inverse=True)
    spans_v, column = np.unique(cells[:, 1], return_inverse=True)
    functions_u, length_u, by_u = _incidence(axes[0], number, spans_u)
    functions_v, length_v, by_v = _incidence(axes[1], number, spans_v)
    shape = len(spans_u), len(spans_v)
    mask = csr_array(((1 + 256 * refined).astype(np.int32), (row, column)), shape=shape)
    count = csr_array(by_u.T.tocsr() @ (mask @ by_v))
    count.sort_indices()
    a = np.repeat(np.arange(count.shape[0]), np.diff(count.indptr))
    b = count.indices
    area = length_u[a] * length_v[b]
    supported = count.data & 255 == area
    active = supported & (count.data >> 8 < area)
    keys = a * len(functions_v) + b
    return Level(
        number=number,
        axes=axes,
        cells=locked(cells),
        refined=locked(refined),
        distinct=(locked(functions_u), locked(functions_v)),
        keys=locked(keys),
        supported=locked(supported),
        active=locked(active),
    )


def _incidence(axis: DyadicAxis, number: int, spans: Integers) -> tuple[Integers, Integers, csr_array]:
    """Return the functions of a level that act on spans, the lengths of their supports in spans, and B: which
    act on which, (spans, functions)."""
    acting = axis.acting(number, spans)[:, None] + np.arange(axis.degree + 1)
    functions = np.unique(acting)
    head, tail = axis.support(number, functions)
    ones = np.ones(acting.size, dtype=np.int32)
    start = np.arange(len(spans) + 1) * acting.shape[1]
    entries = ones, np.searchsorted(functions, acting).ravel(), start
    return functions, tail - head, csr_array(entries, shape=(len(spans), len(functions)))


def numbered(pairs: list[Integers]) -> Integers:
    """Return rows [level, i, j] from one (n, 2) array for each level."""
    levels = np.repeat(np.arange(len(pairs)), [len(p) for p in pairs])
    return read_only(np.column_stack([levels, np.concatenate(pairs)]), np.int64)


def _position(row: Integers, wanted: Integers) -> tuple[Integers, Bools]:
    """Return (index, held) of `wanted` in a sorted row."""
    index = np.minimum(np.searchsorted(row, wanted), max(len(row) - 1, 0))
    return index, row[index] == wanted if len(row) else np.zeros(np.shape(wanted), dtype=bool)
