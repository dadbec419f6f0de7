"""The B-splines that act on every leaf cell: local extraction and evaluation.

On a leaf cell of level l a THB spline is an ordinary B-spline of level l with the coefficients
of the level's net; (p + 1)(q + 1) of them act on the cell.

Source: M. Borden, M. Scott, J. Evans, T. Hughes, Isogeometric finite element data structures
based on Bezier extraction, IJNME 87 (2011); thesis 3.6-3.9.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from thbcad.checks import Floats, Integers, locked
from thbcad.hierarchy.levels import Level
from thbcad.splines import bezier_rows, blossom


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
