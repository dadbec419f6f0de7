"""The target as pixels: a rectangle of what receives light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from optics.scene.receivers.receivers import Plane, Receiver
from thbcad.checks import Floats


@dataclass(frozen=True)
class Screen:
    """Pixels that tile |u| <= half_width[0], |v| <= half_width[1]; row 0 at +v, column 0 at -u.

    pixels : (columns, rows).  margin : dark pixels added on every side, so that light that
    falls beside the target is seen (and charged) too.
    receiver : whose chart says what u and v are.  centre : (u, v) of the middle, which all of this is
    relative to.
    """

    half_width: tuple[float, float]
    pixels: tuple[int, int]
    margin: int = 0
    receiver: Receiver = Plane()
    centre: tuple[float, float] = (0.0, 0.0)

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of the image without margin."""
        return self.pixels[1], self.pixels[0]

    @property
    def padded(self) -> tuple[int, int]:
        """(rows, columns) with margin."""
        return self.pixels[1] + 2 * self.margin, self.pixels[0] + 2 * self.margin

    @property
    def pitch(self) -> tuple[float, float]:
        """Pixel size (x, y), mm or degrees."""
        return 2 * self.half_width[0] / self.pixels[0], 2 * self.half_width[1] / self.pixels[1]

    @property
    def unit(self) -> str:
        """Of lengths on the screen."""
        return self.receiver.unit

    @property
    def angular(self) -> bool:
        """Whether u and v are angles of the far field."""
        return self.receiver.far_field

    @property
    def pixel_area(self) -> float:
        return self.pitch[0] * self.pitch[1]

    @property
    def centres(self) -> tuple[Floats, Floats]:
        """x of the columns and y of the rows, mm or degrees; y falls."""
        x, y = (h * (2 * np.arange(n) + 1 - n) / n for h, n in zip(self.half_width, self.pixels))
        return self.centre[0] + x, self.centre[1] - y

    def projection(self) -> Floats:
        """Return flux per pixel area of a unit picture, (rows, columns): the area over du dv of the receiver.

        So pictures are light per mm^2 of a curved screen, and intensities in the far field.
        """
        u, v = self.centres
        return np.asarray(self.receiver.area(u[None, :], v[:, None]), dtype=np.float64)

    def pixel_map(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return (scale, offset) of column = scale x + offset and of row = scale y + offset."""
        (px, py), (hx, hy), (u, v) = self.pitch, self.half_width, self.centre
        return (1 / px, (hx - u) / px + self.margin), (-1 / py, (hy + v) / py + self.margin)

    def binned(self, points: Floats, weights: Floats) -> Floats:
        """Return the sum of weights in every pixel, (rows, columns), without the margin.

        points : (n, 2), mm or degrees; those beside the screen, and NaN, count nowhere.  weights : (n,).
        """
        columns, rows = self.pixels
        maps = self.pixel_map()
        with np.errstate(invalid="ignore"):  # NaN compares as beside
            column, row = (np.floor(points[:, k] * maps[k][0] + maps[k][1] - self.margin) for k in range(2))
            on = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
        pixel = (row[on] * columns + column[on]).astype(np.int64)
        sums = np.bincount(pixel, weights[on], rows * columns)
        return np.asarray(sums, dtype=np.float64).reshape(self.shape)

    def widened(self, pixels: int) -> Screen:
        """Return a screen with so many more of the same pixels on every side."""
        (px, py), (hx, hy), (columns, rows) = self.pitch, self.half_width, self.pixels
        half_width = hx + pixels * px, hy + pixels * py
        return replace(self, half_width=half_width, pixels=(columns + 2 * pixels, rows + 2 * pixels))

    def finer(self, times: int) -> Screen:
        """Return a screen of the same size with so many times as many pixels in each direction."""
        return replace(self, pixels=(times * self.pixels[0], times * self.pixels[1]))

    def means_of(self, image: Floats, other: Screen) -> Floats:
        """Return the means over this screen's pixels of an image on another's pixels, even within each.

        image : (other's rows, columns).
        """
        across, down = (_shares(self, other, k) for k in (0, 1))
        return np.asarray(down @ image @ across.T)

    def pad(self, image: Floats) -> Floats:
        """Return the image with the dark margin."""
        return np.pad(image, self.margin)

    def crop(self, padded: Floats) -> Floats:
        """Return the image without the margin."""
        m = self.margin
        return padded[m : padded.shape[0] - m, m : padded.shape[1] - m]


def _shares(screen: Screen, other: Screen, axis: int) -> Floats:
    """Return the share of every pixel that each pixel of another screen makes up along u (0) or v (1), down
    the rows, (pixels, other's pixels)."""
    sign = 1 - 2 * axis
    ends, others = (
        s.half_width[axis] * (2 * np.arange(s.pixels[axis] + 1) / s.pixels[axis] - 1) + sign * s.centre[axis]
        for s in (screen, other)
    )
    low = np.maximum(ends[:-1, None], others[None, :-1])
    high = np.minimum(ends[1:, None], others[None, 1:])
    return np.maximum(high - low, 0.0) / np.diff(ends)[:, None]


def lit_part(
    image: Floats, screen: Screen, dark: float
) -> tuple[Floats, tuple[float, float], tuple[float, float]]:
    """Return the least rectangle of an irradiance outside of which all is dark, its centre and half-widths.

    dark : of the greatest irradiance, what counts as dark at most.  Lengths are in mm.
    """
    bright = image > dark * image.max()
    rows, columns = (np.flatnonzero(bright.any(axis=axis)) for axis in (1, 0))
    (hx, hy), (r0, r1, c0, c1) = screen.half_width, (rows[0], rows[-1] + 1, columns[0], columns[-1] + 1)
    wide, tall = hx / image.shape[1], hy / image.shape[0]  # half a pixel
    centre = float((c0 + c1) * wide - hx), float(hy - (r0 + r1) * tall)
    return image[r0:r1, c0:c1], centre, (float((c1 - c0) * wide), float((r1 - r0) * tall))


def with_mirror_images(image: Floats, axes: Sequence[int]) -> Floats:
    """Return an image plus its mirror images, (rows, columns)."""
    for axis in axes:
        image = image + np.flip(image, 1 - axis)
    return image
