"""Lines of pixels: images as running sums of differences between neighbours (Dr.Jit)."""

from __future__ import annotations

import numpy as np

from optics.base.runtime import Backend, DrArray, OrderFreeSums
from optics.light.measuring.pixel_walk import Edges, Pieces

ROUNDING = 2.0**-48  # of all steps of a line: 16 roundings
QUANTA = 2.0**10  # as many as a million summands of a line leave at most, each rounded by half of one


class PixelLines:
    """The lines of a padded screen, along a.

    backend : of double precision.  padded : pixels along a and b.
    """

    def __init__(self, backend: Backend, padded: tuple[int, int]) -> None:
        self._backend, (self._rows, self.columns) = backend, padded
        Int = backend.dr.int32_array_t(backend.Index)
        self.counts = backend.dr.opaque(Int, self._rows), backend.dr.opaque(Int, self.columns)

    def pixels(self, most: float) -> OrderFreeSums:
        """Return no light: of every pixel, by `number`, what lies in it, in the next one along a, in that
        along b, and in that along both.  most : as of `OrderFreeSums`."""
        return OrderFreeSums(self._backend, 4 * (self._rows + 2) * self.columns, most)

    def differences(self, most: float) -> OrderFreeSums:
        """Return no differences: of every pixel a pair, what begins in it and what ends behind it.

        most : of a step from pixel to pixel, the sum of what ends and begins, which alone may be larger.
        """
        return OrderFreeSums(self._backend, 2 * (self._rows + 2) * self.columns, most)

    def number(self, i: DrArray, j: DrArray) -> DrArray:
        """Return the number of a pixel; -1 and the number of pixels count to a line as well."""
        Index = self._backend.Index
        return Index(j) * Index(self.counts[0] + 2) + Index(i + 1)

    def nearest(self, b: DrArray) -> DrArray:
        """Return the number of the line at a whole number b, or nearest to it."""
        return self._backend.Index(self._backend.dr.clip(b, 0, self._backend.Float(self.counts[1] - 1)))

    def next(self, number: DrArray, along_a: DrArray) -> DrArray:
        """Return the number of the next pixel along a or b."""
        dr, Index = self._backend.dr, self._backend.Index
        return number + dr.select(along_a, Index(1), Index(self.counts[0] + 2))

    def on_screen(self, a: DrArray, b: DrArray) -> DrArray:
        """Return whether a point lies on the pixels."""
        rows, columns = (type(a)(n) for n in self.counts)
        return (a >= 0) & (a < rows) & (b >= 0) & (b < columns)

    def add_at(self, differences: OrderFreeSums, flux: DrArray, number: DrArray, exists: DrArray) -> None:
        """Add flux that lies in the pixels of some numbers."""
        differences.add((flux, -flux), number, exists)

    def add(self, differences: OrderFreeSums, piece: Pieces, at: DrArray, behind: DrArray) -> None:
        """Add to the differences before a piece's pixel and behind it."""
        rows, columns = self.counts
        seen = piece.on & (piece.i < rows) & (piece.j >= 0) & (piece.j < columns)
        differences.add((at, behind), self.number(piece.i, piece.j), seen)

    def within(self, edges: Edges, piece: Pieces) -> DrArray:
        """Return how far the middle of a piece lies inside its pixel, 0 to 1.

        It is 1 before the first pixel.
        """
        return self._backend.dr.select(piece.i < 0, 1.0, self.depth(edges, piece))

    def depth(self, edges: Edges, piece: Pieces) -> DrArray:
        """Return how far the middle of a piece lies behind the start of its pixel."""
        return edges.a + edges.da * piece.middle - self._backend.Float(piece.i)

    def light(self, pixels: OrderFreeSums) -> DrArray:
        """Return the image of light in pixels, flat, line by line."""
        parts = pixels.whole.numpy().reshape(self.columns, self._rows + 2, 4)
        image = parts[:, :, 0].copy()
        image[:, 1:] += parts[:, :-1, 1]
        image[1:] += parts[:-1, :, 2]
        image[1:, 1:] += parts[:-1, :-1, 3]
        return self._backend.array(image[:, 1:-1] * pixels.quantum)

    def summed(self, differences: OrderFreeSums) -> DrArray:
        """Return the image of differences, flat, line by line.

        What rounding leaves in dark pixels is taken away, but for cells that are far narrower than a pixel.
        """
        pairs = differences.whole.numpy().reshape(self.columns, self._rows + 2, 2)
        steps = pairs[:, :, 0].copy()
        steps[:, 1:] += pairs[:, :-1, 1]
        image = np.cumsum(steps, axis=1)[:, 1:-1].astype(np.float64)
        dark = np.maximum(ROUNDING * np.abs(steps).sum(axis=1, keepdims=True, dtype=np.float64), QUANTA)
        image[np.abs(image) < dark] = 0.0
        return self._backend.array(image * differences.quantum)

    def integrated(self, image: DrArray) -> tuple[DrArray, DrArray]:
        """Return by `number` the values of an image, and their sums up to the start of every pixel."""
        values = np.pad(image.numpy().reshape(self.columns, self._rows), ((0, 0), (1, 1)))
        sums = np.zeros_like(values)
        np.cumsum(values[:, :-1], axis=1, out=sums[:, 1:])
        return self._backend.array(values), self._backend.array(sums)
