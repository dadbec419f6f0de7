"""Sums of samples over the leaf cells of a THB space."""

from __future__ import annotations

import numpy as np

from thbcad.checks import Floats
from thbcad.hierarchy import THBSpace


def summed_over_cells(space: THBSpace, x: Floats, y: Floats, values: Floats) -> Floats:
    """Return the sum of values on a grid x x y over every leaf cell, (n_cells,).

    Of |dL/dz| it is Z of (6.2).

    values : (nx, ny)
    """
    cell = space.locate(np.repeat(x, len(y)), np.tile(y, len(x)))
    return np.asarray(np.bincount(cell, values.ravel(), len(space.cells)), dtype=np.float64)
