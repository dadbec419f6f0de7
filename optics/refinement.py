"""Which cells to refine: marking by vertex gradients (thesis 6.1-6.3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thbcad.bspline import KnotVector

if TYPE_CHECKING:
    from thbcad.space import THBSpace


def vertex_knots(half_width: Sequence[float], counts: Sequence[int]) -> tuple[KnotVector, ...]:
    """Return degree-1 knot vectors whose knots are a grid of vertices over the surface (6.1)."""
    return tuple(KnotVector.uniform(1, n - 1, -h, h) for n, h in zip(counts, half_width))


def cell_indicator(space: THBSpace, knots: Sequence[KnotVector], gradients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Z per leaf cell: the sum of |dL/dz| over the vertices inside it (6.2), (n_cells,)."""
    x, y = (kv.greville() for kv in knots)
    cell = space.locate(np.repeat(x, len(y)), np.tile(y, len(x)))
    return np.bincount(cell, gradients.ravel(), len(space.cells))


def mark(space: THBSpace, indicator: NDArray[np.float64], alpha: float, max_level: int) -> dict[int, NDArray[np.int64]]:
    """Return {level: cells} of the leaf cells with Z > alpha * mean(Z), below `max_level`.

    The mean is taken over the active cells (thesis 6.3 divides by the number of cells of a full level instead).
    """
    cells = space.cells
    chosen = cells[(indicator > alpha * indicator.mean()) & (cells[:, 0] < max_level)]
    return {int(level): chosen[chosen[:, 0] == level, 1:] for level in np.unique(chosen[:, 0])}
