"""The light that meets the surface that a transport map shapes, mostly the rear, on a grid of cells."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thbcad.checks import Floats
from thbcad.outlines import Outline

DARK = 1e-3  # of the greatest irradiance: nothing is sent there
LEAST_WEIGHT = 1e-3  # of cells without light
PARALLEL = 1e-6  # difference of directions, at most
EVEN = 32  # cells across an outline are a multiple of it: grids are halved, and cosine transforms are fast


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

    @property
    def counts(self) -> tuple[int, int]:
        """Cells in x and y."""
        return self.x.size, self.y.size

    @cached_property
    def flux(self) -> Floats:
        """The density of flux on its own cells, (nx, ny)."""
        return self.emitted(self.counts)

    @property
    def parallel(self) -> bool:
        """Whether its direction is the same everywhere."""
        return max(float(np.ptp(d)) for d in self.direction) < PARALLEL


def centres(half: Sequence[float], cells: Sequence[int]) -> tuple[Floats, Floats]:
    """Return x and y of the centres of (nx, ny) cells of a rectangle around 0 with these half-widths."""
    x, y = (h * ((2 * np.arange(n) + 1) / n - 1) for h, n in zip(half, cells))
    return x, y


def as_many_within(outline: Outline, cells: int) -> int:
    """Return the cells across an outline with which as many lie within as in its rectangle, about."""
    if outline.is_rectangle:
        return cells
    whole = 4 * float(np.prod(outline.half_width))
    return EVEN * round(cells * np.sqrt(whole / outline.area) / EVEN)


def inside(outlines: Iterable[Outline], half: Sequence[float], counts: Sequence[int]) -> Floats:
    """Return the share of every cell of a rectangle with these half-widths that lies in all outlines."""
    x, y = (h * (2 * np.arange(n + 1) / n - 1) for h, n in zip(half, counts))
    x = x[:, None]
    shares = [o.shares((x[:-1], y[:-1]), (x[1:], y[1:])) for o in outlines if not o.is_rectangle]
    return np.minimum.reduce([np.ones((counts[0], counts[1])), *shares])
