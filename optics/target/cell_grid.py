"""Corners, edges and triangles of a grid of cells, by their numbers (Dr.Jit).

The cells' corners are numbered i n + j, n of them along j, and so is everything that belongs to a corner: the
cell towards i + 1, j + 1; its two triangles, of corners (0, 2, 3) and (0, 3, 1) with 1 towards j + 1, 2
towards i + 1 and 3 towards both; the edges to j + 1, to i + 1 and to both, the diagonal.  All first triangles
stand before all second ones, and the edges one kind after the other.  Cells that this numbering adds at the
end of lines must be dark.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from optics.target.pixel_walk import Edges

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray


Corners = tuple[tuple["DrArray", "DrArray"], ...]  # three points (a, b) of every triangle


@dataclass(frozen=True, eq=False)
class Triangles:
    """Two triangles of every cell, the first ones before the second ones; (2 k,) Dr.Jit arrays.

    flux, area : f and A.  density : f / A, 0 where the triangle is laid along an edge.
    """

    corners: Corners
    flux: DrArray
    area: DrArray
    density: DrArray

    def area_change(self, moves: Corners) -> DrArray:
        """Return the rate at which the signed areas change as the corners move."""
        (pa, pb), (qa, qb), (ra, rb) = self.corners
        (ma, mb), (na, nb), (oa, ob) = moves
        first = (na - ma) * (rb - pb) + (qa - pa) * (ob - mb)
        return 0.5 * (first - (oa - ma) * (qb - pb) - (ra - pa) * (nb - mb))


class CellGrid:
    """A grid of corners.

    backend : of double precision.  shape : (m, n) corners.
    """

    def __init__(self, backend: Backend, shape: tuple[int, int]) -> None:
        self._backend = backend
        self.size = shape[0] * shape[1]
        self._count, self._step = (backend.dr.opaque(backend.Index, k) for k in (self.size, shape[1]))

    def at(self, values: DrArray, index: DrArray, exists: DrArray | bool = True) -> DrArray:
        """Return the values at numbers, 0 where they do not exist."""
        return self._backend.dr.gather(self._backend.Float, values, index, exists)

    def triangles(self) -> tuple[DrArray, DrArray, DrArray]:
        """Return of every triangle whether it is the second of its cell, the cell, and whether it exists."""
        dr = self._backend.dr
        triangle = dr.arange(self._backend.Index, 2 * self.size)
        second = triangle >= self._count
        cell = dr.select(second, triangle - self._count, triangle)
        return second, cell, cell + self._step + 1 < self._count

    def triangle_corners(self, a: DrArray, b: DrArray) -> Corners:
        """Return the three points (a, b) of every triangle."""
        second, cell, exists = self.triangles()
        opposite = cell + self._step + 1
        q = self._backend.dr.select(second, opposite, cell + self._step)
        r = self._backend.dr.select(second, cell + 1, opposite)
        return tuple((self.at(a, k, exists), self.at(b, k, exists)) for k in (cell, q, r))

    def of_cells(self, values: DrArray) -> DrArray:
        """Return the values of the cells of every triangle."""
        _, cell, exists = self.triangles()
        return self.at(values, cell, exists)

    def corner_sums(self, values: DrArray) -> DrArray:
        """Return the sum of the values at the four corners of the cell of every triangle."""
        _, cell, exists = self.triangles()
        total = self.at(values, cell, exists)
        for by in (1, self._step, self._step + 1):
            total += self.at(values, cell + by, exists)
        return total

    def edge_sums(self, values: DrArray) -> DrArray:
        """Return the sum of the values of the edges around every triangle, with the signs of its turn."""
        second, cell, exists = self.triangles()
        count = self._count
        diagonal = self.at(values, cell + 2 * count, exists)
        first = self.at(values, cell + count, exists) + self.at(values, cell + self._step, exists) - diagonal
        other = diagonal - self.at(values, cell + 1 + count, exists) - self.at(values, cell, exists)
        return self._backend.dr.select(second, other, first)

    def edges(self, a: DrArray, b: DrArray, density: DrArray) -> tuple[Edges, DrArray]:
        """Return the edges, and the densities of the triangles left of them less those on their right."""
        dr, Index, count, step = self._backend.dr, self._backend.Index, self._count, self._step
        edge = dr.arange(Index, 3 * self.size)
        across, diagonal = edge < count, edge >= 2 * count
        along = ~across & ~diagonal
        start = dr.select(across, edge, dr.select(along, edge - count, edge - 2 * count))
        end = start + dr.select(across, Index(1), dr.select(along, step, step + 1))
        exists = end < count
        left = dr.select(across, start - step, dr.select(along, start, start + count))
        right = dr.select(across, start + count, dr.select(along, start - 1 + count, start))
        difference = self.at(density, left, exists & (~across | (start >= step)))
        difference -= self.at(density, right, exists & (~along | (start >= 1)))
        ua, ub = self.at(a, start, exists), self.at(b, start, exists)
        return Edges(ua, ub, self.at(a, end, exists) - ua, self.at(b, end, exists) - ub), difference

    def by_corners(
        self, a: DrArray, b: DrArray, starts: DrArray, ends: DrArray, turned: DrArray
    ) -> tuple[DrArray, DrArray]:
        """Return the derivatives by a and b, of the six edges and six triangles around every corner.

        starts, ends : of the edges.  They add starts (db, -da) where an edge starts, ends (db, -da) where it
            ends.
        turned : of the triangles, per 2 A.  Of a triangle p q r it adds turned (b_q - b_r, a_r - a_q) at p.
        """
        dr, count, step = self._backend.dr, self._count, self._step
        corner = dr.arange(self._backend.Index, self.size)
        around = {}
        for name, by in (("j", 1), ("i", step), ("ij", step + 1)):
            around[name] = corner + by, corner + by < count
            around["-" + name] = corner - by, corner >= by
        points = {name: (self.at(a, *where), self.at(b, *where)) for name, where in around.items()}
        by_a, by_b = dr.zeros(type(a), self.size), dr.zeros(type(a), self.size)
        for family, name in enumerate(("j", "i", "ij")):
            index, exists = around["-" + name]
            out = self.at(starts, corner + family * count, around[name][1])
            back = self.at(ends, index + family * count, exists)
            (na, nb), (oa, ob) = points[name], points["-" + name]
            by_a += out * (nb - b) + back * (b - ob)
            by_b -= out * (na - a) + back * (a - oa)
        for cell, half, q, r in (
            ("", 0, "i", "ij"),
            ("", 1, "ij", "j"),
            ("-j", 1, "-j", "i"),
            ("-i", 0, "j", "-i"),
            ("-ij", 0, "-ij", "-j"),
            ("-ij", 1, "-i", "-ij"),
        ):
            index, exists = around[cell] if cell else (corner, around["ij"][1])
            part = self.at(turned, index + half * count, exists)
            by_a += part * (points[q][1] - points[r][1])
            by_b += part * (points[r][0] - points[q][0])
        return by_a, by_b

    def around_corners(self, values: DrArray) -> DrArray:
        """Return the sum of the triangles' values over the cells around every corner."""
        dr, count, step = self._backend.dr, self._count, self._step
        corner = dr.arange(self._backend.Index, self.size)
        total = dr.zeros(self._backend.Float, self.size)
        for by in (self._backend.Index(0), self._backend.Index(1), step, step + 1):
            cell, exists = corner - by, corner >= by
            total += self.at(values, cell, exists) + self.at(values, cell + count, exists)
        return total
