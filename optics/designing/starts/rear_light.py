"""The light that meets the surface that a transport map shapes, mostly the rear, on a grid of cells."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

RAYS_PER_CELL = 4  # in each direction
DARK = 1e-3  # of the greatest irradiance: nothing is sent there
LEAST_WEIGHT = 1e-3  # of cells without light

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RearLight:
    """Light of one direction at every point of the rear, or of a front that alone is free, in cells.

    x, y : (nx,), (ny,) cell centres, mm.  direction : three arrays (nx, ny), unit vectors before the surface.
    emitted : called with (nx, ny), returns the density of flux on such a grid.  weight : (nx, ny), of the
        slopes in a fit.
    """

    x: Floats
    y: Floats
    direction: Sequence[Floats]
    emitted: Callable[[tuple[int, ...]], Floats]
    weight: Floats


def centres(half: Sequence[float], cells: Sequence[int]) -> tuple[Floats, Floats]:
    """Return x and y of the centres of (nx, ny) cells of a rectangle around 0 with these half-widths."""
    x, y = (h * ((2 * np.arange(n) + 1) / n - 1) for h, n in zip(half, cells))
    return x, y
