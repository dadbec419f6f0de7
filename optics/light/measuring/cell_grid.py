"""A grid of cells by their corners (Dr.Jit).

The corners are numbered i n + j, n of them along j, and a cell has the number of its first corner.  Its
corners are 0, 1 towards j + 1, 2 towards i + 1, and 3 towards both; those of a turned cell are 1, 0, 3, 2, so
that its triangles meet along the other diagonal.  Cells that this numbering adds at the end of lines must be
dark.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from types import ModuleType

import numpy as np

from optics.base.runtime import Backend, DrArray
from thbcad.checks import Bools


def lowest(dr: ModuleType, *values: DrArray) -> DrArray:
    """Return the least value, in fewer steps than `dr.minimum`, which heeds NaN and signed zeros."""
    return reduce(lambda least, value: dr.select(value < least, value, least), values)


def highest(dr: ModuleType, *values: DrArray) -> DrArray:
    """Return the greatest value, as `lowest`."""
    return reduce(lambda most, value: dr.select(value > most, value, most), values)


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners in pixel units, with a along columns.

    passing : the fraction of their flux that arrives, NaN where a corner is not sound.
    """

    a: DrArray
    b: DrArray
    passing: DrArray


@dataclass(frozen=True, eq=False)
class CellCorners:
    """The corners of cells, and half of the cells' flux."""

    a: list[DrArray]
    b: list[DrArray]
    flux: DrArray


class CellGrid:
    """A grid of corners.

    backend : of double precision.  shape : (m, n) corners.
    turned : (m - 1, n - 1), the cells whose triangles meet along the other diagonal; None is none.
    """

    def __init__(self, backend: Backend, shape: tuple[int, int], turned: Bools | None = None) -> None:
        self._backend = backend
        self.size = shape[0] * shape[1]
        self._count, self._step = (backend.dr.opaque(backend.Index, k) for k in (self.size, shape[1]))
        self._turned = None
        if turned is not None and turned.any():
            every = np.pad(turned, ((0, 1), (0, 1))).ravel()
            self._turned = backend.dr.mask_t(backend.Float)(every)

    def at(self, values: DrArray, index: DrArray, exists: DrArray | bool = True) -> DrArray:
        """Return the values at numbers, 0 where they do not exist."""
        return self._backend.dr.gather(self._backend.Float, values, index, exists)

    def cells(self) -> tuple[DrArray, DrArray]:
        """Return the numbers of all cells, and whether they exist."""
        cell = self._backend.dr.arange(self._backend.Index, self.size)
        return cell, cell + self._step + 1 < self._count

    def corners(self, cell: DrArray) -> tuple[DrArray, ...]:
        """Return the numbers of the four corners of cells, of turned ones too in the order of the grid."""
        return cell, cell + 1, cell + self._step, cell + self._step + 1

    def turned(self, four: Sequence[DrArray], cell: DrArray) -> list[DrArray]:
        """Return what the corners of cells have, from the order of the grid to that of the cells, or back."""
        if self._turned is None:
            return list(four)
        dr = self._backend.dr
        other = dr.gather(dr.mask_t(self._backend.Float), self._turned, cell)
        return [dr.select(other, four[k ^ 1], four[k]) for k in range(4)]

    def of_corners(self, values: DrArray, cell: DrArray, exists: DrArray | bool = True) -> list[DrArray]:
        """Return the values at the four corners of cells, 0 where these do not exist."""
        return [self.at(values, corner, exists) for corner in self.turned(self.corners(cell), cell)]

    def around_corners(self, *values: DrArray) -> list[DrArray]:
        """Return at every corner what the four cells around have: the first whose corner 0 it is, and so on.

        values : of all cells, for each of their corners; 0 where there is no cell.
        """
        dr, Index = self._backend.dr, self._backend.Index
        corner = dr.arange(Index, self.size)
        before = Index(0), Index(1), self._step, self._step + 1
        return [dr.gather(type(v), v, corner - by, corner >= by) for v, by in zip(values, before)]
