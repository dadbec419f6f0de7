"""Exact irradiance of light whose cells are mapped to the target, and its adjoint (Dr.Jit).

A source of two parameters is cut into a grid of cells.  The trace carries their corners to the target, where
every cell becomes two triangles, each with half of the cell's flux.  Triangle k of flux f_k and signed area
A_k has the irradiance |f_k / A_k|, so that pixel P receives

    E_P = sum over k of  f_k / A_k * (signed area of triangle k within P)  / pixel area

exactly: without a window, without noise, and folds add up, since both signs turn together.  By Green's
theorem the signed area within a pixel is an integral over the three edges, of clip(a - i, 0, 1) db for the
pixel i of a line.  Every edge adds its part to the differences between neighbouring pixels, whose running
sums are the image (as fonts are rasterised).

The adjoint of dL = sum over P of g_P dE_P needs of an edge from u to v, p(t) = u + t (v - u),

    J0 = int Phi db,   J1 = int g (1 - t) dt,   J2 = int g t dt,   Phi(a, b) = int_0^a g(a', b) da'.

With m = (J0 of the three edges) / A a triangle's derivative by f is m, and that by its corners is
f / A * J1 (db, -da) at u, f / A * J2 (db, -da) at v for every edge, and -m f / A * dA.

A pixel has many cells.  A triangle that lies in one adds its flux there, and passes no derivative to its
corners.  Cells on two pixels, and around a corner between four, have closed forms (`WholeCells`,
`CornerCells`).  Only the others are followed along their edges (`CutCells`).  One that is thin, with less
than LEAST_AREA, is laid along its longest edge, as thick as it is there; it passes none either.

An edge along a line between pixels makes a kink in the light, if the triangles on both sides of the edge have
different densities.  Symmetric lenses have such edges on their axes.  The derivative at a kink is the mean of
both one-sided derivatives, which are found at corners moved up and down in a and b by ASIDE.

Source of the running sums: R. Levien, Inside the fastest font renderer in the world (2016).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.measuring.cell_grid import CellCorners, CellGrid, Corners
from optics.light.measuring.corner_cells import CornerCells
from optics.light.measuring.cut_cells import CutCells
from optics.light.measuring.pixel_lines import PixelLines
from optics.light.measuring.whole_cells import ALONG_A, ALONG_B, WholeCells, sorted_cells
from optics.scene.receivers import Screen
from thbcad.checks import Bools, Floats

ASIDE = 1e-9  # pixels: how far corners are moved off the lines between pixels, for one-sided derivatives
SHARE = 1 / 8  # of a cell's flux: half is a triangle's, of which a quarter passes as at each corner


@dataclass(frozen=True, eq=False)
class Places:
    """Where cells lie.

    code : of every cell, as of `WholeCells`.
    corner : the numbers of cells with other triangles, which lie around a corner between four pixels.
    cut : the numbers of the cells that may meet pixels with any other triangle.
    """

    code: DrArray
    corner: DrArray
    cut: DrArray


class MappedCells:
    """The map from traced corners to the irradiance on a screen's pixels.

    emitted : (nx, ny) W, of the cells.  corners : (nx + 1, ny + 1) W, the flux that their corners stand for.
    turned : (nx, ny), as of `CellGrid`.
    mirrors : directions (0 for x, 1 for y) in which the cells are one half of symmetric light.  Its corners
        on the axis stay there, so that this axis needs no one-sided derivatives.
    """

    def __init__(
        self,
        backend: Backend,
        screen: Screen,
        emitted: Floats,
        corners: Floats,
        turned: Bools | None = None,
        mirrors: Sequence[int] = (),
    ) -> None:
        self._mirrors = mirrors
        self._backend, self._screen, self._double = backend, screen, backend.with_precision("double")
        corners, cells = corners.reshape([n + 1 for n in emitted.shape]), np.pad(emitted, ((0, 1), (0, 1)))
        shares = SHARE / screen.pixel_area * cells
        self._shares = self._double.array(shares)
        self._light = float(8 * shares.sum())  # of all cells
        self._inverse = self._double.array(
            np.divide(1, corners, out=np.zeros_like(corners), where=corners > 0)
        )
        self._grid = CellGrid(self._double, cells.shape, turned)
        self._lines = PixelLines(self._double, screen.padded)

    def __call__(self, x: DrArray, y: DrArray, flux: DrArray, sound: DrArray) -> DrArray:
        """Return the image as a flat Dr.Jit array, column by column (order "F"), with the screen's margin.

        x, y : of the corners on the target, mm.  flux : W, what arrives of the corners' flux.
        sound : corners that are traced to a definite point; cells with another one are dark.
        """
        (sx, ox), (sy, oy) = (map(self._backend.opaque, pair) for pair in self._screen.pixel_map())
        operation = cell_operation(self._backend.dr.CustomOp)
        return self._backend.custom(operation, self, y * sy + oy, x * sx + ox, flux, sound)

    def corners(self, a: DrArray, b: DrArray, flux: DrArray, sound: DrArray) -> Corners:
        """Return corners in double precision.

        The positions of those that are not sound are not used; they become 0, so that no derivative meets
        infinities.
        """
        dr, Float = self._backend.dr, self._double.Float
        a, b = Float(a), Float(b)
        sound = sound & dr.isfinite(a) & dr.isfinite(b)
        passing = dr.select(sound, Float(flux) * self._inverse, dr.nan)
        out = Corners(dr.select(sound, a, 0.0), dr.select(sound, b, 0.0), passing)
        dr.eval(out.a, out.b, out.passing)
        return out

    def directions(self, corners: Corners, *changes: DrArray) -> tuple[DrArray, ...]:
        """Return changes of a, b and flux in double precision, 0 where corners are not sound."""
        dr, Float = self._backend.dr, self._double.Float
        sound = ~dr.isnan(corners.passing)
        out = tuple(dr.select(sound, Float(change), 0.0) for change in changes)
        dr.eval(out)
        return out

    def sides(self, corners: Corners) -> list[tuple[Corners, Places]]:
        """Return corners whose derivatives by place have the derivative at a kink as their mean.

        These are all corners moved up, and moved down.  There are none where no corner is on a line between
        pixels.
        """
        dr = self._backend.dr
        sound = ~dr.isnan(corners.passing)
        across = [v for axis, v in ((1, corners.a), (0, corners.b)) if axis not in self._mirrors]
        on_lines = [dr.any(sound & (v == dr.floor(v))) for v in across]
        dr.eval(on_lines)
        if not any(on_line.numpy()[0] for on_line in on_lines):
            return []
        moved = [replace(corners, a=corners.a + by, b=corners.b + by) for by in (ASIDE, -ASIDE)]
        return [(side, self.image(side)[1]) for side in moved]

    def image(self, corners: Corners) -> tuple[DrArray, Places]:
        """Return the image, and where the cells lie, which its derivatives take up."""
        dr, pixels, cells = self._backend.dr, self._lines.pixels(self._light), self._cells(corners)
        code, corner, cut = sorted_cells(dr, self._lines, cells)
        WholeCells(dr, self._lines, cells, code).add(pixels)
        dr.eval(pixels.whole, code, corner, cut)
        places = Places(code, dr.compress(corner), dr.compress(cut))
        if dr.width(places.corner):
            CornerCells(*self._some(corners, places, places.corner)).add(pixels)
        image = self._lines.light(pixels)
        if dr.width(places.cut):
            image = image + CutCells(*self._some(corners, places, places.cut)).light()
        return image, places

    def adjoint(self, corners: Corners, places: Places, g: DrArray) -> tuple[DrArray, DrArray, DrArray]:
        """Return the derivatives by a, b and the corners' flux of the sum of g times the image."""
        dr, weights = self._backend.dr, self._lines.integrated(g)
        parts, by_corners = self._of_whole_cells(corners, places, weights[0])
        for kind, cells in ((CornerCells, places.corner), (CutCells, places.cut)):
            if dr.width(cells):
                kind(*self._some(corners, places, cells)).pull_back(weights, parts, by_corners)
        by_a, by_b = dr.gather(self._double.Pair, by_corners, dr.arange(self._backend.Index, self._grid.size))
        return by_a, by_b, self._inverse * sum(self._grid.around_corners(*[parts] * 4))

    def tangent(self, corners: Corners, places: Places, da: DrArray, db: DrArray, change: DrArray) -> DrArray:
        """Return the derivative of the image as corners move by (da, db) and their flux changes.

        The transpose of `adjoint`: a moving edge sweeps J1 and J2, and densities f / A change.
        """
        dr, passing = self._backend.dr, change * self._inverse
        dr.eval(passing)
        moves = self._cells(Corners(da, db, passing))
        whole = WholeCells(dr, self._lines, self._cells(corners), places.code)
        image = whole.swept(self._lines, moves)
        for kind, cells in ((CornerCells, places.corner), (CutCells, places.cut)):
            if dr.width(cells):
                image = image + kind(*self._some(corners, places, cells)).swept(da, db, passing)
        return image

    def _of_whole_cells(self, corners: Corners, places: Places, values: DrArray) -> tuple[DrArray, DrArray]:
        """Return what `CutCells.pull_back` adds to, as the other cells have it.

        values : g, as `PixelLines.integrated`.
        """
        dr, cells = self._backend.dr, self._cells(corners)
        means, slopes = WholeCells(dr, self._lines, cells, places.code).pull_back(values)
        slopes = self._grid.turned(slopes, dr.arange(self._backend.Index, self._grid.size))
        parts, by_a, by_b = means * self._shares, self._double.Float(0), self._double.Float(0)
        dr.eval(parts, slopes)
        for slope, code in zip(*(self._grid.around_corners(*v) for v in (slopes, [places.code] * 4))):
            by_a = by_a + dr.select((code & ALONG_A) > 0, slope, 0.0)
            by_b = by_b + dr.select((code & ALONG_B) > 0, slope, 0.0)
        by_corners = dr.ravel(self._double.Pair(by_a, by_b))
        dr.eval(by_corners)  # instead of four slopes, whose memory others need
        return parts, by_corners

    def _cells(self, corners: Corners) -> CellCorners:
        """Return the corners of all cells."""
        cell, exists = self._grid.cells()
        a, b, passing = (
            self._grid.of_corners(values, cell, exists) for values in (corners.a, corners.b, corners.passing)
        )
        return CellCorners(a, b, self._shares * sum(passing))

    def _some(self, corners: Corners, places: Places, cells: DrArray) -> tuple[Any, ...]:
        """Return the arguments of `CutCells` for some cells, by their numbers."""
        code = self._backend.dr.gather(self._backend.Index, places.code, cells)
        return self._double, self._grid, self._lines, cells, corners, self._shares, code


@cache
def cell_operation(base: type[Any]) -> type[Any]:
    """Return the operation (MappedCells, a, b, flux, sound) -> image.  base : dr.CustomOp."""

    class Mapped(base):
        def eval(self, cells: Any, a: DrArray, b: DrArray, flux: DrArray, sound: DrArray) -> DrArray:
            self.cells, self.Float = cells, type(a)
            self.corners = cells.corners(a, b, flux, sound)
            image, self.places = cells.image(self.corners)
            return self.Float(image)

        def backward(self) -> None:
            g = self.grad_out()
            by_a, by_b, by_flux = self.cells.adjoint(self.corners, self.places, g)
            if sides := [self.cells.adjoint(*side, g) for side in self.cells.sides(self.corners)]:
                by_a, by_b = (sum(slopes) / len(sides) for slopes in list(zip(*sides))[:2])
            for name, slope in (("a", by_a), ("b", by_b), ("flux", by_flux)):
                self.set_grad_in(name, self.Float(slope))

        def forward(self) -> None:
            changes = self.cells.directions(self.corners, *map(self.grad_in, ("a", "b", "flux")))
            sides = self.cells.sides(self.corners) or [(self.corners, self.places)]
            slopes = [self.cells.tangent(*side, *changes) for side in sides]
            self.set_grad_out(self.Float(sum(slopes) / len(slopes)))

    return Mapped
