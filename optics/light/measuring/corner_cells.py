"""Cells around a corner where four pixels meet (Dr.Jit).

Equations and names are those of `MappedCells`, with a and b from that corner on.  An edge has at most one
piece in each of the pixels, where the antiderivative of g is Phi = g a.  Along the lines between pixels db or
a is 0, so that what closes the outline of a triangle's part in a pixel adds nothing.
"""

from __future__ import annotations

from typing import Any

from optics.base.runtime import DrArray, OrderFreeSums
from optics.light.measuring.cell_grid import highest, lowest
from optics.light.measuring.cut_cells import CutCells, Side
from optics.light.measuring.pixel_walk import Numbers

# around the corner: before it or behind, along a and b, in the order of `PixelLines.pixels`
PIXELS = (False, False), (True, False), (False, True), (True, True)


class CornerCells(CutCells):
    """Some cells of a grid, each of which lies in the four pixels around a corner alone; see `CutCells`."""

    def __init__(self, *cells: Any) -> None:
        super().__init__(*cells)
        self._corner = [self._dr.floor(highest(self._dr, *along)) for along in zip(*self._points)]
        i, j = self._corner
        self._pixels = [self._lines.number(i - (not a), j - (not b)) for a, b in PIXELS]

    def add(self, pixels: OrderFreeSums) -> None:
        """Add the light of the triangles that do not lie in one pixel."""
        parts = [[side.density * j0 for j0, _, _ in self._pieces(side)] for side in self._sides]
        pixels.add([sum(row) for row in zip(*parts)], self._pixels[0], once=True)

    def swept(self, da: DrArray, db: DrArray, passing: DrArray) -> DrArray:
        """Return what the image changes where corners move by (da, db) and more of their flux arrives."""
        _, _, changes = self._changes(da, db, passing)
        parts = [
            [sum(c * j for c, j in zip(change, piece)) for piece in self._pieces(side)]
            for side, change in zip(self._sides, changes)
        ]
        lights = [sum(row) for row in zip(*parts)]
        every = self._dr.sum(sum(self._dr.abs(light) for light in lights))
        pixels = self._lines.pixels(float(every.numpy()[0]))
        pixels.add(lights, self._pixels[0], once=True)
        return self._lines.light(pixels)

    def _pieces(self, side: Side) -> list[Numbers]:
        """Return J0, J1, J2 of an edge for g = 1 in each of the four pixels."""
        dr, edges = self._dr, side.edges
        a, b = (start - line for start, line in zip((edges.a, edges.b), self._corner))
        spans = [self._spans(*along) for along in ((a, edges.da), (b, edges.db))]
        out = []
        for sides in PIXELS:
            (from_a, to_a), (from_b, to_b) = (span[behind] for span, behind in zip(spans, sides))
            start, end = highest(dr, from_a, from_b), lowest(dr, to_a, to_b)
            length, middle = highest(dr, end - start, self._Float(0)), 0.5 * (start + end)
            second = length * middle
            out.append((edges.db * (length * a + second * edges.da), length - second, second))
        return out

    def _spans(self, start: DrArray, step: DrArray) -> tuple[tuple[DrArray, DrArray], ...]:
        """Return from where to where in t an edge lies before a line, and behind it."""
        dr = self._dr
        behind = start >= 0
        crossing = dr.select(behind != (start + step >= 0), -start / step, 1.0)
        ends = dr.select(behind, 0.0, crossing), dr.select(behind, crossing, 1.0)
        return (dr.select(behind, crossing, 0.0), dr.select(behind, 1.0, crossing)), ends

    def _integrals(self, side: Side, values: DrArray, sums: DrArray) -> Numbers:
        """Return J0, J1, J2 of an edge."""
        weights = [self._grid.at(values, pixel) for pixel in self._pixels]
        pieces = self._pieces(side)
        return tuple(sum(w * piece[k] for w, piece in zip(weights, pieces)) for k in range(3))
