"""Accumulating rays into pixels with a measurement window, differentiably (Dr.Jit)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from optics.base.runtime import PACKED, Backend, DrArray, OrderFreeSums
from optics.scene.receivers import Screen, Window

WEIGHT = 2.0  # more than the weights of a ray sum up to: 1, of a Gaussian window of 0.3 pixels 1.8


@dataclass(frozen=True)
class Splat:
    """Irradiance of a screen, W/mm^2, from landing points and fluxes.

    window : in which the light is measured.
    light : W, the fluxes of a call sum up to no more; left out, they are summed, which takes a pass over the
        rays.
    """

    backend: Backend
    screen: Screen
    window: Window
    light: float | None = None

    def __call__(self, x: DrArray, y: DrArray, flux: DrArray) -> DrArray:
        """Return the image as a flat Dr.Jit array, column by column (order "F"), with the screen's margin.

        Rays of a beam run along y first; so do the pixels, for the sake of the cache.  Pixels of a column
        that lie side by side are added to in packets, several times as fast as one by one.

        x, y : landing points, mm.  flux : W, zero for rays that do not arrive.
        """
        dr, Float, Index = self.backend.dr, self.backend.Float, self.backend.Index
        screen, taps = self.screen, self.window.taps
        if self.light is None:
            dr.schedule(x, y, flux)  # which are then read twice
        rows, columns = screen.padded
        guard = taps - 1  # pixels around the image for windows that lie across its border
        packets = -(-(guard + PACKED) // PACKED)  # of a column: they hold all taps, wherever these begin
        stride = -(-(rows + 2 * guard + PACKED) // PACKED)  # packets of a column
        opaque, along = self.backend.opaque, dr.opaque(Index, stride)
        height, width = opaque(rows), opaque(columns)
        (sx, ox), (sy, oy) = (map(opaque, pair) for pair in screen.pixel_map())
        shift = 0.5 if taps % 2 == 0 else 0.0
        column, wx = self._taps(x * sx + ox, shift)
        row, wy = self._taps(y * sy + oy, shift)
        touches = (row >= -guard) & (column >= -guard) & (row < height) & (column < width)
        start = Index(dr.select(touches, row + guard, 0))
        first = Index(dr.select(touches, column + guard, 0)) * along + start // PACKED
        wy = self._shifted(wy, start % PACKED, packets * PACKED)
        flux = flux * opaque(1.0 / screen.pixel_area)
        values, numbers = [], []
        for a in range(taps):
            line, weighted = first + Index(a) * along, flux * wx[a]
            for k in range(packets):
                values.append(self.backend.Packet(*(weighted * w for w in wy[k * PACKED : (k + 1) * PACKED])))
                numbers.append(line + k)
        size = stride * PACKED * (columns + 2 * guard)
        most = None if self.light is None else WEIGHT * self.light / screen.pixel_area
        operation = scatter_operation(dr.CustomOp)
        image = self.backend.custom(operation, self.backend, size, values, numbers, touches, most)
        pixel, tall = dr.arange(Index, rows * columns), dr.opaque(Index, rows)
        return dr.gather(Float, image, (pixel // tall + guard) * (along * PACKED) + pixel % tall + guard)

    def _taps(self, position: DrArray, shift: float) -> tuple[DrArray, list[DrArray]]:
        """Return (first pixel, weights) in one direction."""
        dr = self.backend.dr
        taps = self.window.taps
        cell = dr.floor(dr.detach(position) - shift)
        return cell - (taps - 1) // 2, self.window.weights(position - shift - cell, dr.exp)

    def _shifted(self, weights: list[DrArray], by: DrArray, count: int) -> list[DrArray]:
        """Return `count` weights, the given ones after `by` zeros, by < PACKED."""
        row = [*weights, *[0.0] * (count - len(weights))]
        for bit in (1, 2):
            moved = (by & bit) != 0
            before = [*[0.0] * bit, *row]
            row = [self.backend.dr.select(moved, before[j], row[j]) for j in range(count)]
        return row


@cache
def scatter_operation(base: type[Any]) -> type[Any]:
    """Return the operation (backend, size, packets, numbers, active, most) -> sums.

    size : how many sums.  packets : of summands that are added side by side.
    numbers : which of the packets of sums they are added to.  active : which rays add any.
    most : as of `OrderFreeSums`; None for the sum of the moduli of all summands.  base : dr.CustomOp.
    """

    class Scattered(base):
        def eval(
            self,
            backend: Backend,
            size: int,
            packets: list[DrArray],
            numbers: list[DrArray],
            active: DrArray,
            most: float | None,
        ) -> DrArray:
            self.backend, self.size, self.numbers, self.active = backend, size, numbers, active
            self.Packet = type(packets[0])
            return self.summed(packets, self.moduli(packets) if most is None else most)

        def backward(self) -> None:
            gather, slopes = self.backend.dr.gather, self.grad_out()
            packets = [gather(self.Packet, slopes, number, self.active) for number in self.numbers]
            self.set_grad_in("packets", packets)

        def forward(self) -> None:
            changes = self.grad_in("packets")
            self.set_grad_out(self.summed(changes, self.moduli(changes)))

        def moduli(self, packets: list[DrArray]) -> float:
            """Return the sum of the moduli of all summands."""
            dr = self.backend.dr
            of_ray = sum(dr.abs(number) for packet in packets for number in packet)
            return float(dr.sum(dr.select(self.active, of_ray, 0)).numpy()[0])

        def summed(self, packets: list[DrArray], most: float) -> DrArray:
            sums = OrderFreeSums(self.backend, self.size, most)
            for packet, number in zip(packets, self.numbers):
                sums.add(tuple(packet), number, self.active)
            return sums.values()

    return Scattered
