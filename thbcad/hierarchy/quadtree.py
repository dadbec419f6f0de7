"""The leaf cell of a point, by a linear quadtree.

Cells are numbered along a Z-shaped curve: the level-0 cell first, then the bits of i and j of
the deeper levels in turn.  A leaf cell is an interval of the finest level's numbers, and a
point is found by one binary search.

Source: I. Gargantini, An effective way to represent quadtrees, Comm. ACM 25 (1982).
"""

import numpy as np

from thbcad.checks import Floats, Integers
from thbcad.hierarchy.levels import DyadicAxis

_MASKS = (
    (16, 0x0000FFFF0000FFFF),
    (8, 0x00FF00FF00FF00FF),
    (4, 0x0F0F0F0F0F0F0F0F),
    (2, 0x3333333333333333),
    (1, 0x5555555555555555),
)


class Quadtree:
    """Leaf cells in the order of the curve; cells : (n, 3) int [level, i, j] that tile the domain."""

    def __init__(self, axes: tuple[DyadicAxis, DyadicAxis], cells: Integers) -> None:
        self._axes = axes
        self._top = int(cells[:, 0].max())
        shift = self._top - cells[:, 0]
        codes = self._codes(cells[:, 1] << shift, cells[:, 2] << shift)
        self._order = np.argsort(codes)
        self._codes_in_order = codes[self._order]

    def locate(self, u: Floats, v: Floats) -> Integers:
        """Return the index in `cells` of the cell that holds each point of the domain."""
        i, j = (axis.span_at(self._top, x) for axis, x in zip(self._axes, (u, v)))
        return self._order[np.searchsorted(self._codes_in_order, self._codes(i, j), side="right") - 1]

    def _codes(self, i: Integers, j: Integers) -> Integers:
        top = self._top
        below = (1 << self._top) - 1
        base = (i >> top) * self._axes[1].spans(0) + (j >> top)
        return (base << (2 * top)) + (_spread(i & below) << 1) + _spread(j & below)


def _spread(bits: Integers) -> Integers:
    """Return the numbers with a zero before every bit; up to 31 bits."""
    for shift, mask in _MASKS:
        bits = (bits | (bits << shift)) & mask
    return bits
