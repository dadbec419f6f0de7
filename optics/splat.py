"""Accumulating rays into pixels with a measurement window, differentiably (Dr.Jit)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from optics.screen import Screen
from optics.windows import BoxWindow, BSplineWindow, GaussianWindow, PixelWindow

if TYPE_CHECKING:
    from optics.backend import Backend, DrArray


@dataclass(frozen=True)
class Splat:
    """Irradiance of a screen, W/mm^2, from landing points and fluxes.

    screen : Screen; window : a measurement window
    """

    backend: Backend
    screen: Screen
    window: BoxWindow | PixelWindow | BSplineWindow | GaussianWindow

    def __call__(self, x: DrArray, y: DrArray, flux: DrArray) -> DrArray:
        """Return the image as a flat Dr.Jit array, column by column (order "F"), with the screen's margin.

        Rays of a beam run along y first; so do the pixels, for the sake of the cache.

        x, y : landing points, mm.  flux : W, zero for rays that do not arrive.
        """
        dr, Float, Index = self.backend.dr, self.backend.Float, self.backend.Index
        screen, taps = self.screen, self.window.taps
        rows, columns = screen.padded
        guard = taps - 1  # pixels around the image for windows that reach over its border
        # sizes are opaque, so that every screen runs the same compiled kernel
        height, width, stride = dr.opaque(Float, rows), dr.opaque(Float, columns), dr.opaque(Index, rows + 2 * guard)
        (sx, ox), (sy, oy) = ((dr.opaque(Float, a), dr.opaque(Float, b)) for a, b in screen.pixel_map())
        shift = 0.5 if taps % 2 == 0 else 0.0
        column, wx = self._taps(x * sx + ox, shift)
        row, wy = self._taps(y * sy + oy, shift)
        touches = (row >= -guard) & (column >= -guard) & (row < height) & (column < width)
        first = Index(dr.select(touches, column + guard, 0)) * stride + Index(dr.select(touches, row + guard, 0))
        image = dr.zeros(Float, (rows + 2 * guard) * (columns + 2 * guard))
        flux = flux * dr.opaque(Float, 1.0 / screen.pixel_area)
        for a in range(taps):
            line = first + Index(a) * stride
            weighted = flux * wx[a]
            for b in range(taps):
                dr.scatter_reduce(dr.ReduceOp.Add, image, weighted * wy[b], line + b, touches)
        if guard == 0:
            return image
        pixel, tall = dr.arange(Index, rows * columns), dr.opaque(Index, rows)
        return dr.gather(Float, image, (pixel // tall + guard) * stride + pixel % tall + guard)

    def _taps(self, position: DrArray, shift: float) -> tuple[DrArray, list[DrArray]]:
        """Return (first pixel, weights) in one direction."""
        dr = self.backend.dr
        taps = self.window.taps
        cell = dr.floor(dr.detach(position) - shift)
        return cell - (taps - 1) // 2, self.window.weights(position - shift - cell, dr.exp)
