"""Cells that lie in one pixel, or in two neighbouring ones: what of their light each gets (Dr.Jit).

Let u, v, w be the distances of a triangle's corners from the line between the two pixels, u that of the one
which is alone on its side.  On this side lies the part

    s = u^2 / ((u - v) (u - w)),  ds/dv = s / (u - v),  ds/dw = s / (u - w),  ds/du = 2 s / u - ds/dv - ds/dw

of the triangle.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from types import ModuleType

from optics.base.runtime import DrArray, OrderFreeSums
from optics.light.measuring.cell_grid import CellCorners, highest, lowest
from optics.light.measuring.cut_cells import LEAST_AREA, TRIANGLES, signed_area
from optics.light.measuring.pixel_lines import PixelLines

FIRST, SECOND, ALONG_A, ALONG_B = 1, 2, 4, 8  # bits of a cell's code
BITS = 4


def sorted_cells(dr: ModuleType, lines: PixelLines, cells: CellCorners) -> tuple[DrArray, DrArray, DrArray]:
    """Return of all cells their codes, and which lie around a corner between pixels, or are cut otherwise."""
    a, b, lit = cells.a, cells.b, cells.flux > 0  # not where a corner is not sound, or there is no cell
    pixels = [[dr.floor(v) for v in along] for along in (a, b)]
    starts, ends = ([extreme(dr, *along) for along in pixels] for extreme in (lowest, highest))
    meets = lit
    for start, end, count in zip(starts, ends, lines.counts):
        meets = meets & (end >= 0) & (start < type(start)(count))
    first, second = (
        reduce(lambda one, at: one & (at[0] == at[q]) & (at[0] == at[r]), pixels, lit)
        for _, q, r in TRIANGLES
    )
    least = lowest(dr, *(dr.abs(signed_area([(a[k], b[k]) for k in t])) for t in TRIANGLES))
    near = meets & (least >= LEAST_AREA) & lines.on_screen(*starts) & lines.on_screen(*ends)
    (same_a, next_a), (same_b, next_b) = (
        (end == start, end == start + 1) for start, end in zip(starts, ends)
    )
    along_a, along_b, corner = near & next_a & same_b, near & same_a & next_b, near & next_a & next_b
    two = along_a | along_b
    i, j = (dr.select(two, start, at[0]) for start, at in zip(starts, pixels))
    inside = (first | second | two) & lines.on_screen(i, j)
    code = lines.number(dr.select(inside, i, 0), dr.select(inside, j, 0)) << BITS
    codes = zip((FIRST, SECOND, ALONG_A, ALONG_B), (first | two, second | two, along_a, along_b))
    for bit, has in codes:
        code = code | dr.select(has, type(code)(bit), 0)
    return dr.select(inside, code, 0), corner, meets & ~(first & second | two | corner)


class WholeCells:
    """All cells of a grid, by their codes.

    code : 16 times the number of a pixel; plus FIRST and SECOND for triangles that lie in it; plus ALONG_A or
        ALONG_B where these lie in it and in the next pixel along a or b.
    """

    def __init__(self, dr: ModuleType, lines: PixelLines, cells: CellCorners, code: DrArray) -> None:
        self._dr, self._flux, Float = dr, cells.flux, type(cells.flux)
        self._along_a, self._along_b = (code & ALONG_A) > 0, (code & ALONG_B) > 0
        self._across = self._along_a | self._along_b
        self._lit, self._pixel = (code & (FIRST | SECOND)) > 0, code >> BITS
        self._next = lines.next(self._pixel, self._along_a)
        self._triangles = Float((code & FIRST) + ((code & SECOND) >> 1))
        places = self._over(cells.a, cells.b)
        line = dr.floor(highest(dr, *places))
        self._behind, self._slopes = Float(0), [Float(0)] * len(places)
        for triangle in TRIANGLES:
            part, slopes = _part_behind(dr, [places[k] - line for k in triangle], self._across)
            self._behind = self._behind + part
            for k, slope in zip(triangle, slopes):
                self._slopes[k] = self._slopes[k] + slope

    def add(self, pixels: OrderFreeSums) -> None:
        """Add the light of the triangles."""
        self._add(pixels, self._flux, self._behind * self._flux)

    def pull_back(self, values: DrArray) -> tuple[DrArray, list[DrArray]]:
        """Return the sum of the means of g over a cell's triangles, and the derivatives by the places of its
        corners: by a where it lies along a, else by b.

        values : g, as `PixelLines.integrated`.
        """
        dr, Float = self._dr, type(self._flux)
        value = dr.gather(Float, values, self._pixel, self._lit)
        step = dr.gather(Float, values, self._next, self._across) - value
        change = dr.select(self._across, step * self._flux, 0.0)
        return self._triangles * value + self._behind * step, [change * slope for slope in self._slopes]

    def swept(self, lines: PixelLines, moves: CellCorners) -> DrArray:
        """Return by how much the image changes where corners move and the flux changes."""
        dr, flux = self._dr, moves.flux
        moved = sum(slope * move for slope, move in zip(self._slopes, self._over(moves.a, moves.b)))
        beyond = self._behind * flux + dr.select(self._across, moved * self._flux, 0.0)
        pixels = lines.pixels(float(dr.sum(2 * dr.abs(flux) + dr.abs(beyond)).numpy()[0]))
        self._add(pixels, flux, beyond)
        return lines.light(pixels)

    def _add(self, pixels: OrderFreeSums, flux: DrArray, beyond: DrArray) -> None:
        dr = self._dr
        along_a, along_b = (dr.select(on, beyond, 0.0) for on in (self._along_a, self._along_b))
        light = self._triangles * flux - beyond
        pixels.add((light, along_a, along_b, type(flux)(0)), self._pixel, self._lit)

    def _over(self, a: Sequence[DrArray], b: Sequence[DrArray]) -> list[DrArray]:
        """Return of every corner what is across the line between pixels."""
        return [self._dr.select(self._along_a, *pair) for pair in zip(a, b)]


def _part_behind(
    dr: ModuleType, distances: Sequence[DrArray], across: DrArray
) -> tuple[DrArray, list[DrArray]]:
    """Return the part of a triangle with distances from 0 on, and its derivatives."""
    first, second, third = (distance >= 0 for distance in distances)
    meets = across & ~((first == second) & (second == third))
    at_second, at_third = meets & (first == third), meets & (first == second)

    def turned(values: Sequence[DrArray], order: tuple[int, int, int]) -> DrArray:
        """Return one of the values, by whether the first, second or third corner is alone."""
        p, q, r = (values[k] for k in order)
        return dr.select(at_third, r, dr.select(at_second, q, p))

    u, v, w = (turned(distances, order) for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1)))
    # places on pixels are multiples of 2^-53, so that this product is not too small
    inverse = dr.select(meets, 1 / ((u - v) * (u - w)), 0.0)
    alone = dr.select(meets, u, 0.0)
    part = alone * alone * inverse
    by_v, by_w = part * inverse * (alone - w), part * inverse * (alone - v)
    slopes = [2 * alone * inverse - by_v - by_w, by_v, by_w]
    sign = dr.select(u >= 0, 1.0, -1.0)
    behind = dr.select((u >= 0) == meets, part, 1 - part)
    order = (0, 2, 1), (1, 0, 2), (2, 1, 0)
    return dr.select(across, behind, 0.0), [sign * turned(slopes, back) for back in order]
