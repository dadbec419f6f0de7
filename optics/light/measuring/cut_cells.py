"""Cells that lie on more than one pixel: their triangles, edge by edge (Dr.Jit).

Equations and names are those of `MappedCells`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from optics.base.runtime import Backend, DrArray, OrderFreeSums
from optics.light.measuring.cell_grid import CellGrid, Corners, highest, lowest
from optics.light.measuring.pixel_lines import PixelLines
from optics.light.measuring.pixel_walk import Edges, Numbers, Pieces, walk

Point: TypeAlias = "tuple[DrArray, DrArray]"
Change: TypeAlias = "tuple[DrArray, DrArray, DrArray]"

TRIANGLES = (0, 2, 3), (0, 3, 1)  # corners of a cell
# of a cell: from corner to corner, the triangle on the left, and that on the right where it is the cell's too
SIDES = ((0, 2), 0, None), ((2, 3), 0, None), ((0, 3), 1, 0), ((3, 1), 1, None), ((1, 0), 1, None)
LEAST_AREA = 1e-9  # square pixels: what lies on a caustic, or is folded there
LEAST = 1e-300  # what is divided by where edges, square pixels, or their parts have no length


@dataclass(frozen=True, eq=False)
class _Triangle:
    """One triangle of every cell, as Dr.Jit arrays.

    corners : three points (a, b).  area : signed.  density : flux / area.
    spread, thin : masks; a triangle that meets no pixel, or lies in one, is neither, and without density.
    """

    corners: tuple[Point, ...]
    area: DrArray
    density: DrArray
    spread: DrArray
    thin: DrArray

    def area_change(self, moves: Sequence[Point]) -> DrArray:
        """Return the rate at which the area changes as the corners move."""
        (pa, pb), (qa, qb), (ra, rb) = self.corners
        (ma, mb), (na, nb), (oa, ob) = moves
        first = (na - ma) * (rb - pb) + (qa - pa) * (ob - mb)
        return 0.5 * (first - (oa - ma) * (qb - pb) - (ra - pa) * (nb - mb))


@dataclass(frozen=True, eq=False)
class Side:
    """An edge of every cell, from corner to corner.

    density : of the triangle on its left less that on its right, of those that the cell has.
    spread : one of these is spread.
    """

    start: int
    end: int
    left: int
    right: int | None
    edges: Edges
    density: DrArray
    spread: DrArray


def signed_area(corners: Sequence[Point]) -> DrArray:
    """Return the area of a triangle."""
    (pa, pb), (qa, qb), (ra, rb) = corners
    return 0.5 * ((qa - pa) * (rb - pb) - (ra - pa) * (qb - pb))


class CutCells:
    """Some cells of a grid, by their numbers.

    shares : of all cells, an eighth of their flux per area of a pixel.
    whole : of these cells, bits that say which triangles lie in one pixel: 1 for the first, 2 for the second.
    """

    def __init__(
        self,
        backend: Backend,
        grid: CellGrid,
        lines: PixelLines,
        cells: DrArray,
        corners: Corners,
        shares: DrArray,
        whole: DrArray,
    ) -> None:
        self._dr, self._Float, self._Pair = backend.dr, backend.Float, backend.Pair
        self._grid, self._lines, self._cells = grid, lines, cells
        self._points = self._at_corners(corners.a, corners.b)
        self._share = grid.at(shares, cells)
        self._flux = self._share * sum(grid.of_corners(corners.passing, cells))
        self._triangles = [self._triangle(k, (whole & (k + 1)) == 0) for k in (0, 1)]
        self._sides = [self._side(*side) for side in SIDES]

    def light(self) -> DrArray:
        """Return the image of the triangles that do not lie in one pixel."""
        dr, differences = self._dr, self._lines.differences(self._most())
        for side in self._sides:

            def add(numbers: Numbers, piece: Pieces, side: Side = side) -> Numbers:
                within = self._lines.within(side.edges, piece)
                part = side.density * (piece.length * side.edges.db)
                self._lines.add(differences, piece, part * (within - 1), -part * within)
                return numbers

            walk(dr, side.edges, side.density != 0, self._lines.counts, add)
        thin = dr.any(self._triangles[0].thin | self._triangles[1].thin)
        dr.eval(differences.whole, thin)
        if thin.numpy()[0]:
            for triangle in self._triangles:
                self._lay(triangle, differences)
        return self._lines.summed(differences)

    def _most(self) -> float:
        """Return a bound of the steps from pixel to pixel: no pixel has more light than what all cells that
        meet its line may lay on one."""
        dr = self._dr
        along = [dr.floor(b) for _, b in self._points]
        least = lowest(dr, *(dr.abs(triangle.area) for triangle in self._triangles))
        half = dr.select(least > 1, self._flux / least, self._flux)
        starts, ends = (self._lines.nearest(extreme(dr, *along)) for extreme in (lowest, highest))
        dr.eval(half, starts, ends)
        half, starts, ends = (array.numpy() for array in (half, starts, ends))
        # what meets a line less what meets a line before
        begun, ended = (np.bincount(at, half, self._lines.columns + 1) for at in (starts, ends + 1))
        return float(2 * np.cumsum(begun - ended).max())

    def pull_back(self, weights: tuple[DrArray, DrArray], parts: DrArray, by_corners: DrArray) -> None:
        """Add the derivatives.

        weights : g, as `PixelLines.integrated`.
        parts : by the sum of the four corners' share that arrives, of every cell, to which these are added.
        by_corners : by a and b of every corner, side by side in memory.
        """
        dr, integrals = self._dr, [self._integrals(side, *weights) for side in self._sides]
        slopes = [(self._Float(0), self._Float(0)) for _ in self._points]
        sums = [self._Float(0), self._Float(0)]
        for side, (j0, j1, j2) in zip(self._sides, integrals):
            sums[side.left] = sums[side.left] + j0
            if side.right is not None:
                sums[side.right] = sums[side.right] - j0
            da, db = side.edges.da, side.edges.db
            for corner, j in ((side.start, side.density * j1), (side.end, side.density * j2)):
                slopes[corner] = slopes[corner][0] + j * db, slopes[corner][1] - j * da
        mean = self._Float(0)
        for numbers, triangle, j0 in zip(TRIANGLES, self._triangles, sums):
            inside, pixel = self._middle(triangle)
            there = dr.select(triangle.spread, j0 / triangle.area, self._grid.at(weights[0], pixel, inside))
            mean, turned = mean + there, -0.5 * triangle.density * there
            for p, q, r in (numbers[k:] + numbers[:k] for k in range(3)):
                (by_a, by_b), (qa, qb), (ra, rb) = slopes[p], self._points[q], self._points[r]
                slopes[p] = by_a + turned * (qb - rb), by_b + turned * (ra - qa)
        pairs = self._grid.turned([self._Pair(*slope) for slope in slopes], self._cells)
        # at the k-th corners of cells no two of them meet
        dr.scatter_reduce(
            dr.ReduceOp.Add, parts, self._share * mean, self._cells, mode=dr.ReduceMode.NoConflicts
        )
        dr.eval(parts, pairs)
        for corner, pair in zip(self._grid.corners(self._cells), pairs):
            dr.scatter_reduce(dr.ReduceOp.Add, by_corners, pair, corner, mode=dr.ReduceMode.NoConflicts)
            dr.eval(by_corners)

    def swept(self, da: DrArray, db: DrArray, passing: DrArray) -> DrArray:
        """Return what the image changes where corners move by (da, db) and more of their flux arrives."""
        dr, (flux, every, changes) = self._dr, self._changes(da, db, passing)
        # a rate acts on what lies in a pixel of a triangle's area, and edges sweep where they lie
        every = every + sum(dr.abs(number) for _, *ends in changes for number in ends)
        differences = self._lines.differences(float(dr.sum(every).numpy()[0]))
        for triangle in self._triangles:
            inside, pixel = self._middle(triangle)
            self._lines.add_at(differences, flux, pixel, inside)
        for side, change in zip(self._sides, changes):

            def add(numbers: Numbers, piece: Pieces, side: Side = side, change: Change = change) -> Numbers:
                rate, first, last = change
                within = self._lines.within(side.edges, piece)
                part = rate * (piece.length * side.edges.db)
                swept = piece.length * (first + piece.middle * (last - first))
                self._lines.add(differences, piece, part * (within - 1) + swept, -part * within - swept)
                return numbers

            walk(dr, side.edges, side.spread, self._lines.counts, add)
        return self._lines.summed(differences)

    def _changes(self, da: DrArray, db: DrArray, passing: DrArray) -> tuple[DrArray, DrArray, list[Change]]:
        """Return the change of half of a cell's flux, the moduli of its and its triangles', and of every edge
        by how much the density on its left grows, less that on its right, and what its ends sweep."""
        dr, moves = self._dr, self._at_corners(da, db)
        flux = self._share * sum(self._grid.of_corners(passing, self._cells))
        rates, every = [], 2 * dr.abs(flux)
        for numbers, triangle in zip(TRIANGLES, self._triangles):
            area = triangle.area_change([moves[k] for k in numbers])
            change = dr.select(triangle.spread, flux - triangle.density * area, 0.0)
            rates.append(dr.select(triangle.spread, change / triangle.area, 0.0))
            every = every + dr.abs(change)
        changes = []
        for side in self._sides:
            rate = rates[side.left] if side.right is None else rates[side.left] - rates[side.right]
            (ua, ub), (va, vb) = moves[side.start], moves[side.end]
            da, db = side.edges.da, side.edges.db
            changes.append((rate, *(side.density * (db * a - da * b) for a, b in ((ua, ub), (va, vb)))))
        return flux, every, changes

    def _at_corners(self, a: DrArray, b: DrArray) -> list[Point]:
        return list(zip(*(self._grid.of_corners(values, self._cells) for values in (a, b))))

    def _triangle(self, number: int, counts: DrArray) -> _Triangle:
        """Return a triangle of every cell; what meets no pixel would leave its rounding."""
        dr, corners = self._dr, tuple(self._points[k] for k in TRIANGLES[number])
        counts = counts & (self._flux > 0)
        for along, count in zip(zip(*corners), self._lines.counts):
            least, most = (extreme(dr, *along) for extreme in (lowest, highest))
            counts = counts & (most >= 0) & (least < self._Float(count))
        area = signed_area(corners)
        spread = counts & (dr.abs(area) >= LEAST_AREA)
        density = dr.select(spread, self._flux / area, 0.0)
        return _Triangle(corners, area, density, spread, counts & ~spread)

    def _side(self, ends: tuple[int, int], left: int, right: int | None) -> Side:
        (ua, ub), (va, vb) = (self._points[k] for k in ends)
        density, spread = self._triangles[left].density, self._triangles[left].spread
        if right is not None:
            density = density - self._triangles[right].density
            spread = spread | self._triangles[right].spread
        return Side(*ends, left, right, Edges(ua, ub, va - ua, vb - ub), density, spread)

    def _integrals(self, side: Side, values: DrArray, sums: DrArray) -> Numbers:
        """Return J0, J1, J2 of an edge."""
        dr, lines = self._dr, self._lines

        def integrate(numbers: Numbers, piece: Pieces) -> Numbers:
            seen = piece.on & (piece.j >= 0) & (piece.j < lines.counts[1])
            pixel = lines.number(piece.i, piece.j)
            value, phi = self._grid.at(values, pixel, seen), self._grid.at(sums, pixel, seen)
            phi = phi + value * lines.depth(side.edges, piece)
            weights = phi * side.edges.db, value * (1 - piece.middle), value * piece.middle
            return tuple(dr.select(piece.on, n + w * piece.length, n) for n, w in zip(numbers, weights))

        zeros = tuple(dr.zeros(self._Float, dr.width(self._cells)) for _ in range(3))
        return walk(dr, side.edges, side.spread, lines.counts, integrate, zeros)

    def _lay(self, triangle: _Triangle, differences: OrderFreeSums) -> None:
        """Lay thin triangles along their longest edges."""
        dr, corners = self._dr, triangle.corners
        rows = self._lines.counts[0]
        squares = [
            dr.square(v[0] - u[0]) + dr.square(v[1] - u[1])
            for u, v in zip(corners, corners[1:] + corners[:1])
        ]
        second = (squares[1] > squares[0]) & (squares[1] >= squares[2])
        third = ~second & (squares[2] > squares[0])

        def chosen(order: tuple[int, int, int]) -> list[DrArray]:
            points = (corners[k] for k in order)
            return [dr.select(third, z, dr.select(second, y, x)) for x, y, z in zip(*points)]

        (ua, ub), (va, vb), (wa, wb) = (chosen(k) for k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)))
        da, db = va - ua, vb - ub
        square = dr.maximum(da * da + db * db, LEAST)
        widest = dr.clip(((wa - ua) * da + (wb - ub) * db) / square, 0, 1)

        def up_to(t: DrArray) -> DrArray:
            """Return the part of the flux from the start of the edge: the width rises and falls linearly."""
            t = dr.clip(t, 0, 1)
            rest = 1 - t
            falling = 1 - rest * rest / dr.maximum(1 - widest, LEAST)
            return dr.select(t < widest, t * t / dr.maximum(widest, LEAST), falling)

        def lay(numbers: Numbers, piece: Pieces) -> Numbers:
            half = 0.5 * piece.length
            share = up_to(piece.middle + half) - up_to(piece.middle - half)
            part = dr.select((piece.i >= 0) & (piece.i < rows), self._flux * share, 0)
            self._lines.add(differences, piece, part, -part)
            return numbers

        walk(dr, Edges(ua, ub, da, db), triangle.thin, self._lines.counts, lay)

    def _middle(self, triangle: _Triangle) -> tuple[DrArray, DrArray]:
        """Return which triangles are thin with their middle on a pixel, and the number of this pixel."""
        dr = self._dr
        a, b = (dr.floor(sum(along) / 3) for along in zip(*triangle.corners))
        inside = triangle.thin & self._lines.on_screen(a, b)
        return inside, self._lines.number(*(dr.select(inside, along, 0) for along in (a, b)))
