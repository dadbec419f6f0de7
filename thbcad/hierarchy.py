"""Integer bookkeeping of dyadic refinement.

At level l every non-empty span of the first knot vector is cut into 2^l equal parts.  Breaks
and spans are counted in integers; break b of level l stands for the rational position
b / 2^l in the row of level-0 breaks, so that no rounding accumulates with the level.
Old knots keep their multiplicity, new ones are simple.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thbcad.bspline import KnotVector


@dataclass(frozen=True, eq=False)
class Level:
    """One level: its existing cells in compressed coordinates and its active functions."""

    rows: NDArray[np.int64]  # distinct i of the cells of Omega_l
    columns: NDArray[np.int64]  # distinct j
    inside: NDArray[np.bool_]  # (rows, columns) bool, cell lies in Omega_l
    refined: NDArray[np.bool_]  # (rows, columns) bool, cell is refined
    supported: NDArray[np.int64]  # (n, 2) functions (i, j) whose support lies in Omega_l
    heads: NDArray[np.int64]  # (n, 2) breaks of the level at which their supports start
    active: NDArray[np.bool_]  # (n,) bool, the support is not inside Omega_(l+1)

    @property
    def functions(self) -> NDArray[np.int64]:
        """Active functions (i, j), (m, 2) int."""
        return self.supported[self.active]

    @property
    def leaves(self) -> NDArray[np.bool_]:
        return self.inside & ~self.refined


class DyadicAxis:
    """Knots, spans and functions of all levels above one knot vector, found by arithmetic."""

    def __init__(self, knot_vector: KnotVector) -> None:
        self.knot_vector = knot_vector
        self.degree = knot_vector.degree
        self.spans0 = knot_vector.spans
        _, multiplicity = np.unique(knot_vector.knots, return_counts=True)
        self._multiplicity = multiplicity
        self._surplus = np.r_[0, np.cumsum(multiplicity - 1)]

    def spans(self, level: int) -> int:
        """Return the number of non-empty spans of a level."""
        return self.spans0 << level

    def value(self, level: int, breaks: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the positions of breaks of a level, float."""
        row = self.knot_vector.breaks
        whole = np.minimum(breaks >> level, self.spans0 - 1)
        share = (breaks - (whole << level)) / float(1 << level)
        inside = row[whole] + (row[whole + 1] - row[whole]) * share
        return np.where(breaks == self.spans(level), row[-1], inside)

    def multiplicity(self, level: int, breaks: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return how often each break occurs in the knot vector of a level."""
        old = (breaks & ((1 << level) - 1)) == 0
        return np.where(old, self._multiplicity[breaks >> level], 1)

    def first_knot(self, level: int, breaks: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the index of the first knot at each break of a level."""
        whole = -((-breaks) >> level)
        return breaks + self._surplus[whole]

    def functions_within(self, level: int, spans: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return the functions of a level whose support consists of the given spans.

        Parameters
        ----------
        spans : (n,) int, sorted and distinct

        Returns
        -------
        index, start, length : (m,) int; function index[k] covers the spans
            spans[start[k]] ... spans[start[k] + length[k] - 1].
        """
        count = self.multiplicity(level, spans)
        start = np.repeat(np.arange(len(spans)), count)
        rank = np.arange(len(start)) - np.repeat(np.cumsum(count) - count, count)
        head = spans[start]
        index = self.first_knot(level, head) + rank
        length = self.support_length(level, index, head)
        end = start + length - 1
        whole = end < len(spans)
        whole &= spans[np.minimum(end, len(spans) - 1)] == head + length - 1
        return index[whole], start[whole], length[whole]

    def support_length(self, level: int, index: NDArray[np.int64], head: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the number of spans in the supports of functions `index`, which start at the breaks `head`."""
        length = np.zeros_like(index)
        for step in range(1, self.degree + 2):
            tail = np.minimum(head + step, self.spans(level))
            length += (head + step <= self.spans(level)) & (self.first_knot(level, tail) <= index + self.degree + 1)
        return length

    def knots_around(self, level: int, span: int) -> NDArray[np.float64]:
        """Return the p knots of a level on either side of a span, (2p,)."""
        p = self.degree
        breaks = np.arange(max(0, span - p), min(self.spans(level), span + 1 + p) + 1)
        count = self.multiplicity(level, breaks)
        last = int(count[breaks <= span].sum()) - 1
        return np.repeat(self.value(level, breaks), count)[last - p + 1 : last + p + 1]

    def knots_with(self, level: int, keys: NDArray[np.int64]) -> tuple[KnotVector, NDArray[np.int64]]:
        """Return the level-0 knots together with simple knots at the breaks `keys` of a level."""
        old = np.repeat(np.arange(self.spans0 + 1) << level, self._multiplicity)
        all_keys = np.sort(np.r_[old, keys])
        knots = self.value(level, all_keys)
        if (np.diff(knots)[np.diff(all_keys) > 0] <= 0).any():
            raise ValueError(f"level {level} is too deep: neighbouring knots coincide in float64")
        return KnotVector(self.degree, knots), all_keys

    def span_at(self, level: int, u: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return for parameters u inside the domain the span of a level that contains them."""
        row = self.knot_vector.breaks
        whole = np.clip(np.searchsorted(row, u, "right") - 1, 0, self.spans0 - 1)
        share = (u - row[whole]) / (row[whole + 1] - row[whole])
        span = (whole << level) + np.minimum((share * (1 << level)).astype(np.int64), (1 << level) - 1)
        # the product may round across a break: settle it by the breaks themselves
        span -= u < self.value(level, span)
        up = (span + 1 < self.spans(level)) & (u >= self.value(level, np.minimum(span + 1, self.spans(level))))
        return np.maximum(span + up, 0)
