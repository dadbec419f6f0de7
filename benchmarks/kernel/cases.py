"""The cases of the kernel benchmark: the annulus hierarchy that five codes agree on, and a bicubic
surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thbcad import KnotVector, THBSpace

SPANS = 7
WIDTHS = (0.25, 0.15, 0.08, 0.04, 0.02)


@dataclass(frozen=True, eq=False)
class Annulus:
    """The case: degree 3, 7 x 7 spans on [0, 1]^2, refined five times about a circle.

    marks : per level the refined cells, (n, 2) int
    functions, before : (dim, 3) int [level, i, j], in this order, after the last refinement and before it
    grid : (g,) parameters of the grid, points : (2, n) scattered (u, v)
    """

    marks: Sequence[NDArray[np.int64]]
    functions: NDArray[np.int64]
    before: NDArray[np.int64]
    grid: NDArray[np.float64]
    points: NDArray[np.float64]

    @property
    def grid_points(self) -> NDArray[np.float64]:
        """The points of the grid x grid, (2, g^2)."""
        return np.stack(np.meshgrid(self.grid, self.grid, indexing="ij")).reshape(2, -1)


def annulus_case() -> Annulus:
    """Return the annulus case: hierarchy, spline and points."""
    marks = annulus_marks()
    points = np.random.default_rng(0).random((2, 201_601))
    return Annulus(
        marks, annulus(marks).functions, annulus(marks[:-1]).functions, np.linspace(0, 1, 449), points
    )


def annulus_marks() -> list[NDArray[np.int64]]:
    """Return the cells of every level that meet the open annulus |r - 0.3| < w about (1/2, 1/2)."""
    marks = []
    for level, width in enumerate(WIDTHS):
        n = SPANS << level
        # in units of 1 / (2 n), so that the test is exact up to the square root
        low, high = np.arange(n) / n - 0.5, (np.arange(n) + 1) / n - 0.5
        near = np.where((low <= 0) & (high >= 0), 0.0, np.minimum(abs(low), abs(high)))
        far = np.maximum(abs(low), abs(high))
        least, most = np.hypot.outer(near, near), np.hypot.outer(far, far)
        marks.append(np.argwhere((least < 0.3 + width) & (most > 0.3 - width)))
    return marks


def annulus(marks: Sequence[NDArray[np.int64]]) -> THBSpace:
    """Return the annulus hierarchy."""
    kv = KnotVector.uniform(3, SPANS)
    return refined(THBSpace(kv, kv), marks)


def refined(space: THBSpace, marks: Sequence[NDArray[np.int64]]) -> THBSpace:
    """Return the space in which the given cells of every level are refined in turn."""
    for level, cells in enumerate(marks):
        space = space.refine({level: cells})
    return space


def coefficients(functions: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the oracle's coefficients, (dim,)."""
    level, i, j = functions.T.astype(float)
    return np.sin(1.3 * i + 2.1 * j + 0.7 * level) + 0.3 * np.cos(0.37 * i * j + level)


def tensor_case() -> tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
]:
    """Return knots, a net (227, 227, 3), the parameters of a grid and 100 new knots."""
    kv = KnotVector.uniform(3, 224)
    net = np.random.default_rng(1).random((kv.dim, kv.dim, 3))
    return kv.knots, net, np.linspace(0, 1, 449), (np.arange(100) + 0.37) / 100
