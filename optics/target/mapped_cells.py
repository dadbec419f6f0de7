"""Exact irradiance of light whose cells are mapped to the target, and its adjoint (Dr.Jit).

A source of two parameters is cut into a grid of cells.  The trace carries their corners to the target, where
every cell becomes two triangles, each with half of the cell's flux.  Triangle k of flux f_k and signed area
A_k has the irradiance |f_k / A_k|, so that pixel P receives

    E_P = sum over k of  f_k / A_k * (signed area of triangle k within P)  / pixel area

exactly: without a window, without noise, and folds add up, since both signs turn together.  By Green's
theorem the signed area within a pixel is an integral over the three edges, of clip(a - i, 0, 1) db for the
pixel i of a line.  Every edge adds its part to the differences between neighbouring pixels, whose running
sums are the image (as fonts are rasterised).  Triangles share edges, so each is followed once, with the
difference of the densities f / A on its two sides.

The adjoint of dL = sum over P of g_P dE_P needs of an edge from u to v, p(t) = u + t (v - u),

    J0 = int Phi db,   J1 = int g (1 - t) dt,   J2 = int g t dt,   Phi(a, b) = int_0^a g(a', b) da'.

With m = (J0 of the three edges) / A a triangle's derivative by f is m, and that by its corners is
f / A * J1 (db, -da) at u, f / A * J2 (db, -da) at v for every edge, and -m f / A * dA.

A triangle that lies in one pixel, or has less than LEAST_AREA, is laid along its longest edge, as thick as it
is there; it passes no derivative to its corners.

Source of the running sums: R. Levien, Inside the fastest font renderer in the world (2016).
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.target.cell_grid import CellGrid, Triangles
from optics.target.cell_operation import cell_operation
from optics.target.pixel_walk import Edges, Numbers, Pieces, walk

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray
    from optics.target.screen import Screen

LEAST_AREA = 1e-9  # square pixels: what lies on a caustic, or is folded there
SHARE = 1 / 8  # of a cell's flux: half is a triangle's, of which a quarter passes as at each corner
LEAST = 1e-300  # what is divided by where edges, square pixels, or their parts have no length


class MappedCells:
    """The map from traced corners to the irradiance on a screen's pixels.

    emitted : (nx, ny) W, of the cells.  corners : (nx + 1, ny + 1) W, the flux that their corners stand for.
    """

    def __init__(
        self,
        backend: Backend,
        screen: Screen,
        emitted: NDArray[np.float64],
        corners: NDArray[np.float64],
    ) -> None:
        dr, self._backend, self._screen = backend.dr, backend, screen
        self._double = backend.doubled()
        Int = dr.int32_array_t(backend.Index)
        corners, cells = corners.reshape([n + 1 for n in emitted.shape]), np.pad(emitted, ((0, 1), (0, 1)))
        self._cells = self._double.array(cells / screen.pixel_area)
        self._inverse = self._double.array(
            np.divide(1, corners, out=np.zeros_like(corners), where=corners > 0)
        )
        self._grid = CellGrid(self._double, cells.shape)
        self._rows, self._columns = screen.padded
        self._counts = dr.opaque(Int, self._rows), dr.opaque(Int, self._columns)

    def __call__(self, x: DrArray, y: DrArray, flux: DrArray, sound: DrArray) -> DrArray:
        """Return the image as a flat Dr.Jit array, column by column (order "F"), with the screen's margin.

        x, y : of the corners on the target, mm.  flux : W, what arrives of the corners' flux.
        sound : corners that are traced to a definite point; cells with another one are dark.
        """
        Float = self._backend.Float
        (sx, ox), (sy, oy) = self._screen.pixel_map()
        sx, ox, sy, oy = (self._backend.dr.opaque(Float, number) for number in (sx, ox, sy, oy))
        operation = cell_operation(self._backend.dr.CustomOp)
        return self._backend.dr.custom(operation, self, y * sy + oy, x * sx + ox, flux, sound)

    def in_double(self, a: DrArray, b: DrArray, flux: DrArray, sound: DrArray) -> tuple[DrArray, ...]:
        """Return a, b and the fraction of the corners' flux that arrives, NaN where a corner is not sound.

        The positions of these corners are not used; they become 0, so that no derivative meets infinities.
        """
        dr, Float = self._backend.dr, self._double.Float
        a, b = Float(a), Float(b)
        sound = sound & dr.isfinite(a) & dr.isfinite(b)
        passing = dr.select(sound, Float(flux) * self._inverse, dr.nan)
        out = dr.select(sound, a, 0.0), dr.select(sound, b, 0.0), passing
        dr.eval(out)
        return out

    def directions(self, passing: DrArray, *changes: DrArray) -> tuple[DrArray, ...]:
        """Return changes of a, b and flux in double precision, 0 where corners are not sound."""
        dr, Float = self._backend.dr, self._double.Float
        sound = ~dr.isnan(passing)
        out = tuple(dr.select(sound, Float(change), 0.0) for change in changes)
        dr.eval(out)
        return out

    def image(self, a: DrArray, b: DrArray, passing: DrArray) -> DrArray:
        """Return the image for corners in pixel units; passing : the fraction of their flux that arrives.

        a : along columns.  passing is NaN where a corner is not sound.
        """
        dr, Float = self._backend.dr, self._double.Float
        differences = dr.zeros(Float, 2 * (self._rows + 2) * self._columns)
        triangles = self._triangles(a, b, passing)
        self._lay(triangles, differences)
        dr.eval(triangles.density, differences)
        edges, density = self._grid.edges(a, b, triangles.density)

        def add(numbers: Numbers, piece: Pieces) -> Numbers:
            within = dr.select(piece.i < 0, 1.0, edges.a + edges.da * piece.middle - Float(piece.i))
            part = density * (piece.length * edges.db)
            self._add(differences, piece, part * (within - 1), -part * within)
            return numbers

        walk(dr, edges, density != 0, self._counts, add)
        return self._summed(differences)

    def adjoint(
        self, a: DrArray, b: DrArray, passing: DrArray, g: DrArray
    ) -> tuple[DrArray, DrArray, DrArray]:
        """Return the derivatives by a, b and the corners' flux of the sum of g times the image."""
        dr, Float = self._backend.dr, self._double.Float
        triangles = self._triangles(a, b, passing)
        dr.eval(triangles.density)
        edges, density = self._grid.edges(a, b, triangles.density)
        values, sums = self._with_border(g)
        stride = dr.opaque(self._backend.Index, self._rows + 1)

        def integrate(numbers: Numbers, piece: Pieces) -> Numbers:
            seen = piece.on & (piece.i >= 0) & (piece.j >= 0) & (piece.j < self._counts[1])
            at = self._backend.Index(piece.j) * stride + self._backend.Index(piece.i)
            value = dr.gather(Float, values, at, seen)
            phi = dr.gather(Float, sums, at, seen)
            phi = phi + value * (edges.a + edges.da * piece.middle - Float(piece.i))
            weights = phi * edges.db, value * (1 - piece.middle), value * piece.middle
            return tuple(dr.select(piece.on, n + w * piece.length, n) for n, w in zip(numbers, weights))

        zeros = tuple(dr.zeros(Float, 3 * self._grid.size) for _ in range(3))
        j0, j1, j2 = walk(dr, edges, density != 0, self._counts, integrate, zeros)
        starts, ends = density * j1, density * j2
        dr.eval(j0, starts, ends)
        mean = self._means(triangles, j0, values, stride)
        turned = -0.5 * triangles.density * mean
        dr.eval(mean, turned)
        by_flux = SHARE * self._grid.around_corners(mean * self._grid.of_cells(self._cells))
        return *self._grid.by_corners(a, b, starts, ends, turned), self._inverse * by_flux

    def tangent(
        self,
        a: DrArray,
        b: DrArray,
        passing: DrArray,
        da: DrArray,
        db: DrArray,
        change: DrArray,
    ) -> DrArray:
        """Return the derivative of the image as corners move by (da, db) and their flux changes.

        The transpose of `adjoint`: a moving edge sweeps J1 and J2, and densities f / A change.
        """
        dr, Float, half = self._backend.dr, self._double.Float, SHARE * self._grid.of_cells(self._cells)
        differences = dr.zeros(Float, 2 * (self._rows + 2) * self._columns)
        triangles = self._triangles(a, b, passing)
        lit, spread = triangles.flux > 0, triangles.density != 0
        flux = dr.select(lit, half * self._grid.corner_sums(change * self._inverse), 0.0)
        area = triangles.area_change(self._grid.triangle_corners(da, db))
        rates = dr.select(spread, (flux - triangles.density * area) / triangles.area, 0.0)
        inside, row, column = self._middles(triangles)
        at = column * self._backend.Index(self._counts[0] + 2) + row + 1
        dr.scatter_reduce(dr.ReduceOp.Add, differences, self._double.Pair(flux, -flux), at, inside)
        dr.eval(triangles.density, rates, differences)
        edges, density = self._grid.edges(a, b, triangles.density)
        moving, rate = self._grid.edges(da, db, rates)
        at_start = edges.db * moving.a - edges.da * moving.b
        at_end = at_start + edges.db * moving.da - edges.da * moving.db

        def add(numbers: Numbers, piece: Pieces) -> Numbers:
            within = dr.select(piece.i < 0, 1.0, edges.a + edges.da * piece.middle - Float(piece.i))
            part = rate * (piece.length * edges.db)
            swept = density * piece.length * (at_start + piece.middle * (at_end - at_start))
            self._add(differences, piece, part * (within - 1) + swept, -part * within - swept)
            return numbers

        walk(dr, edges, (density != 0) | (rate != 0), self._counts, add)
        return self._summed(differences)

    def _triangles(self, a: DrArray, b: DrArray, passing: DrArray) -> Triangles:
        """Return the triangles; those that are dark or meet no pixel have no flux."""
        dr = self._backend.dr
        corners = self._grid.triangle_corners(a, b)
        flux = SHARE * self._grid.of_cells(self._cells) * self._grid.corner_sums(passing)
        lit = flux > 0  # not where a corner is not sound
        for along, count in zip(zip(*corners), self._counts):  # what meets no pixel would leave its rounding
            least, most = (reduce(extreme, along) for extreme in (dr.minimum, dr.maximum))
            lit &= (most >= 0) & (least < self._double.Float(count))
        flux = dr.select(lit, flux, 0.0)
        (pa, pb), (qa, qb), (ra, rb) = corners
        area = 0.5 * ((qa - pa) * (rb - pb) - (ra - pa) * (qb - pb))
        one = (dr.floor(pa) == dr.floor(qa)) & (dr.floor(pa) == dr.floor(ra))
        one &= (dr.floor(pb) == dr.floor(qb)) & (dr.floor(pb) == dr.floor(rb))
        spread = (flux > 0) & ~one & (dr.abs(area) >= LEAST_AREA)
        return Triangles(corners, flux, area, dr.select(spread, flux / area, 0.0))

    def _lay(self, triangles: Triangles, differences: DrArray) -> None:
        """Lay the triangles without density along their longest edges."""
        dr, corners = self._backend.dr, triangles.corners
        rows = self._counts[0]
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
            part = dr.select((piece.i >= 0) & (piece.i < rows), triangles.flux * share, 0)
            self._add(differences, piece, part, -part)
            return numbers

        laid = (triangles.flux > 0) & (triangles.density == 0)
        walk(dr, Edges(ua, ub, da, db), laid, self._counts, lay)

    def _add(self, differences: DrArray, piece: Pieces, at: DrArray, behind: DrArray) -> None:
        """Add to the differences before a piece's pixel and behind it, which lie side by side in memory."""
        dr, Index, (rows, columns) = self._backend.dr, self._backend.Index, self._counts
        seen = piece.on & (piece.i < rows) & (piece.j >= 0) & (piece.j < columns)
        index = Index(piece.j) * Index(rows + 2) + Index(piece.i + 1)
        dr.scatter_reduce(dr.ReduceOp.Add, differences, self._double.Pair(at, behind), index, seen)

    def _summed(self, differences: DrArray) -> DrArray:
        pairs = differences.numpy().reshape(self._columns, self._rows + 2, 2)
        steps = pairs[:, :, 0].copy()
        steps[:, 1:] += pairs[:, :-1, 1]
        return self._double.array(np.cumsum(steps, axis=1)[:, 1:-1])

    def _with_border(self, g: DrArray) -> tuple[DrArray, DrArray]:
        """Return g and Phi at the start of every pixel, with another pixel at the end of columns."""
        values = np.pad(g.numpy().reshape(self._columns, self._rows), ((0, 0), (0, 1)))
        sums = np.zeros_like(values)
        np.cumsum(values[:, :-1], axis=1, out=sums[:, 1:])
        return self._double.array(values), self._double.array(sums)

    def _means(self, triangles: Triangles, j0: DrArray, values: DrArray, stride: DrArray) -> DrArray:
        """Return the mean of g over every triangle; of one that is laid along an edge g at its middle."""
        spread = triangles.density != 0
        inside, row, column = self._middles(triangles)
        dr = self._backend.dr
        whole = self._grid.edge_sums(j0) / dr.select(spread, triangles.area, 1.0)
        return dr.select(spread, whole, self._grid.at(values, column * stride + row, inside))

    def _middles(self, triangles: Triangles) -> tuple[DrArray, DrArray, DrArray]:
        """Return which triangles are laid with their middle on a pixel, and this pixel's row and column."""
        dr, Index = self._backend.dr, self._backend.Index
        middle = [dr.floor(sum(coordinate) / 3) for coordinate in zip(*triangles.corners)]
        inside = (triangles.density == 0) & (triangles.flux > 0)
        for along, count in zip(middle, self._counts):
            inside &= (along >= 0) & (along < type(along)(count))
        return inside, *(Index(dr.select(inside, along, 0)) for along in middle)
