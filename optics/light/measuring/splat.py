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
        that lie side by side are added to in packets, several times as fast as one by one.  There are as many
        copies of the pixels as a packet has numbers: the k-th begins with pixel k, so that in one of them
        the ray's first pixel begins a packet.

        x, y : landing points, mm.  flux : W, zero for rays that do not arrive.
        """
        dr, Float, Index = self.backend.dr, self.backend.Float, self.backend.Index
        screen, taps = self.screen, self.window.taps
        if self.light is None:
            dr.schedule(x, y, flux)  # which are then read twice
        rows, columns = screen.padded
        guard = taps - 1  # pixels around the image for windows that lie across its border
        pieces = _pieces(taps)
        copies = pieces[0][1]
        column_size = -(-(rows + 2 * guard + PACKED) // PACKED) * PACKED
        size = column_size * (columns + 2 * guard)
        opaque, along, apart = self.backend.opaque, dr.opaque(Index, column_size), dr.opaque(Index, size)
        height, width = opaque(rows), opaque(columns)
        (sx, ox), (sy, oy) = (map(opaque, pair) for pair in screen.pixel_map())
        shift = 0.5 if taps % 2 == 0 else 0.0
        column, wx = self._taps(x * sx + ox, shift)
        row, wy = self._taps(y * sy + oy, shift)
        touches = (row >= -guard) & (column >= -guard) & (row < height) & (column < width)
        start = Index(dr.select(touches, row + guard, 0))
        first = Index(dr.select(touches, column + guard, 0)) * along
        first += start % copies * apart + start // copies * copies
        flux = flux * opaque(1.0 / screen.pixel_area)
        packets, numbers = [], []
        for a in range(taps):
            line, weighted = first + Index(a) * along, flux * wx[a]
            for begin, wide in pieces:
                run = [weighted * w for w in wy[begin : begin + wide]]
                packets.append(tuple(run + [self.backend.Float(0)] * (wide - len(run))))
                numbers.append((line + begin) // wide)
        most = None if self.light is None else WEIGHT * self.light / screen.pixel_area
        operation = scatter_operation(dr.CustomOp)
        image = self.backend.custom(operation, self.backend, (copies, size), packets, numbers, touches, most)
        pixel, tall = dr.arange(Index, rows * columns), dr.opaque(Index, rows)
        return dr.gather(Float, image, (pixel // tall + guard) * along + pixel % tall + guard)

    def _taps(self, position: DrArray, shift: float) -> tuple[DrArray, list[DrArray]]:
        """Return (first pixel, weights) in one direction."""
        dr = self.backend.dr
        taps = self.window.taps
        cell = dr.floor(dr.detach(position) - shift)
        return cell - (taps - 1) // 2, self.window.weights(position - shift - cell, dr.exp)


def _pieces(taps: int) -> list[tuple[int, int]]:
    """Return the packets that hold a run of taps: (first tap, 1, 2 or 4 numbers), the widest first."""
    pieces, begin = [], 0
    while begin < taps:
        wide = min(PACKED, 1 << (taps - begin - 1).bit_length())
        pieces.append((begin, wide))
        begin += wide
    return pieces


@cache
def scatter_operation(base: type[Any]) -> type[Any]:
    """Return the operation (backend, (copies, size), packets, numbers, active, most) -> sums.

    copies, size : of how many sums, see `OrderFreeSums.folded`.  packets : of one, two or four summands that
        are added side by side.
    numbers : which of the packets of sums they are added to.  active : which rays add any.
    most : as of `OrderFreeSums`; None for the sum of the moduli of all summands.  base : dr.CustomOp.
    """

    class Scattered(base):
        def eval(
            self,
            backend: Backend,
            layout: tuple[int, int],
            packets: list[tuple[DrArray, ...]],
            numbers: list[DrArray],
            active: DrArray,
            most: float | None,
        ) -> DrArray:
            self.backend, self.layout, self.numbers, self.active = backend, layout, numbers, active
            self.wide = [len(packet) for packet in packets]
            return self.summed(packets, self.moduli(packets) if most is None else most)

        def backward(self) -> None:
            (copies, size), backend = self.layout, self.backend
            dr, apart = backend.dr, backend.dr.opaque(backend.Index, size)
            place = dr.arange(backend.Index, copies * size)
            at = place % apart + place // apart
            slopes = dr.gather(backend.Float, self.grad_out(), at, at < size)  # of all copies
            kinds = {1: backend.Float, 2: backend.Pair, 4: backend.Packet}
            packets = [
                dr.gather(kinds[wide], slopes, number, self.active)
                for wide, number in zip(self.wide, self.numbers)
            ]
            self.set_grad_in(
                "packets", [tuple(p) if wide > 1 else (p,) for p, wide in zip(packets, self.wide)]
            )

        def forward(self) -> None:
            changes = self.grad_in("packets")
            self.set_grad_out(self.summed(changes, self.moduli(changes)))

        def moduli(self, packets: list[tuple[DrArray, ...]]) -> float:
            """Return the sum of the moduli of all summands."""
            dr = self.backend.dr
            of_ray = sum(dr.abs(number) for packet in packets for number in packet)
            return float(dr.sum(dr.select(self.active, of_ray, 0)).numpy()[0])

        def summed(self, packets: list[tuple[DrArray, ...]], most: float) -> DrArray:
            copies, size = self.layout
            sums = OrderFreeSums(self.backend, copies * size, most)
            for packet, number in zip(packets, self.numbers):
                sums.add(packet, number, self.active)
            return sums.folded(copies)

    return Scattered
