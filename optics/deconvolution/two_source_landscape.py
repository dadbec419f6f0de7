"""Loss landscapes of two equal sources: the best residual by their distance (thesis, Figures 7.7 and 7.8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.etendue import Approximation, Array, approximate_two_deltas
from thbcad.checks import read_only

PIXELS = 256  # on [-1, 1]: a step of 1/128 is one pixel
SIDE, RADIUS = 0.5, 0.33
STEPS = 20
MARKS = {"square": ((0, 8), (6, 6), (8, 0)), "disk": ((0, 4), (8, 4), (13, 4))}  # (m, n): columns, rows


@dataclass(frozen=True, eq=False)
class Landscape:
    """The certified best residuals ||E * F - G|| / ||G||, by the position of the second source.

    It lies n rows and m columns from the first.

    residual, lower_bound, kkt : (STEPS + 1, STEPS + 1), at [n, m]
    """

    residual: Array
    lower_bound: Array
    kkt: Array


def square(pixels: int = PIXELS, side: float = SIDE) -> Array:
    """Return the square |x|, |y| <= side / 2 on [-1, 1]^2: 1 in the pixels whose middles lie in it."""
    lit = np.abs(_middles(pixels)) <= side / 2
    return np.outer(lit, lit).astype(np.float64)


def disk(pixels: int = PIXELS, radius: float = RADIUS) -> Array:
    """Return the disk x^2 + y^2 <= radius^2 on [-1, 1]^2: 1 in the pixels whose middles lie in it."""
    x = _middles(pixels)
    return (np.hypot(x[:, None], x) <= radius).astype(np.float64)


def two_sources(target: Array, m: int, n: int) -> Approximation:
    """Return the best light for equal sources at the origin and m columns and n rows from it (7.42)."""
    return approximate_two_deltas((n, m), (1.0, 1.0), target)


def landscape(target: Array, steps: int = STEPS) -> Landscape:
    """Return the landscape over m, n = 0 .. steps.  target : dark in a border of `steps` pixels."""
    best = [[two_sources(target, m, n) for m in range(steps + 1)] for n in range(steps + 1)]
    return Landscape(
        residual=read_only([[one.residual for one in row] for row in best]),
        lower_bound=read_only([[one.lower_bound for one in row] for row in best]),
        kkt=read_only([[one.kkt for one in row] for row in best]),
    )


def _middles(pixels: int) -> Array:
    return (np.arange(pixels) + 0.5) * 2 / pixels - 1
