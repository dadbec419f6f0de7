"""Source blurs on a pixel grid, and the linear convolution with them.

The light F has more pixels than its image: light beyond the border of the image comes into it by the blur.
An image of n x m pixels and a kernel of k x l taps belong to (n + k - 1) x (m + l - 1) pixels of
light.

Source: thesis 7.1-7.2 and 7.28-7.30, as a convolution in two dimensions with zeros outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from thbcad.checks import EPS, Floats, read_only

Real = NDArray[np.floating]

Rows = NDArray[np.intp]

MOST_FAINT = 2048  # pixels of light that are summed tap by tap: those that meet the image least
# roundings of a transform per factor of 2 in its size: radices up to 5 take 11 at most
BUTTERFLY = 16
FEW_TAPS = 12  # up to so many, shifted copies are added faster than transforms are made


class Blur(Protocol):
    """A linear map A of light, or of its coefficients, to images (n, m); no entry of A is negative."""

    def apply(self, light: Real, /) -> Real:
        """Return A f."""

    def adjoint(self, image: Real, /) -> Real:
        """Return A^T y."""

    def column_sums(self, shape: tuple[int, ...], /) -> Floats:
        """Return A^T 1 for images of the given shape."""


class PixelBlur(Blur, Protocol):
    """A `Blur` of pixels of light, by one kernel or by several of one shape."""

    @property
    def weights(self) -> Floats:
        """The kernel, or the mean of the kernels, (k, l)."""

    def light_shape(self, shape: tuple[int, ...], /) -> tuple[int, int]:
        """Return the shape of the light for images of the given shape."""

    def greatest_mean(self, image: Floats, /) -> float:
        """Return a number that no A^T y / A^T 1 exceeds, see `Kernel.greatest_mean`."""


@dataclass(frozen=True, eq=False)
class Kernel:
    """A blur of flux 1.

    weights : (k, l) float, k and l odd, non-negative; divided by their sum; [k // 2, l // 2] is the tap
        without a shift

    Raises ValueError : weights with an even side, negative or not finite, or without flux.
    """

    weights: Floats

    def __post_init__(self) -> None:
        w = require_light("weights", self.weights)
        if w.shape[0] % 2 == 0 or w.shape[1] % 2 == 0:
            raise ValueError(
                f"weights must have odd sides, so that a tap lies in the middle, got shape {w.shape}"
            )
        object.__setattr__(self, "weights", read_only(w / w.sum()))

    @classmethod
    def points(cls, shifts: ArrayLike, weights: ArrayLike) -> Kernel:
        """Return the blur of point sources; equal shifts add up.

        shifts : (n, 2) int, rows and columns
        weights : (n,)
        """
        at, w = np.asarray(shifts), np.asarray(weights, dtype=np.float64)
        if (
            at.ndim != 2
            or at.shape[1] != 2
            or w.shape != at.shape[:1]
            or not np.issubdtype(at.dtype, np.integer)
        ):
            raise ValueError(
                f"shifts must be whole numbers of shape (n, 2) with n weights, "
                f"got shapes {at.shape} and {w.shape}"
            )
        farthest = np.abs(at).max(axis=0)
        taps = np.zeros(2 * farthest + 1)
        np.add.at(taps, tuple((at + farthest).T), w)
        return cls(taps)

    @classmethod
    def rectangle(cls, half_rows: float, half_columns: float) -> Kernel:
        """Return a uniform rectangle, half sides in pixels; every tap is the exact area in its pixel."""
        return cls(np.outer(_covered(half_rows), _covered(half_columns)))

    @classmethod
    def disk(cls, radius: float) -> Kernel:
        """Return a uniform disk, radius in pixels; every tap is the exact area in its pixel.

        It is the second difference of a(x, y) = integral from 0 to x of min(y, sqrt(1 - u^2)) du, odd in x
        and in y.
        """
        edge = _edges(radius) / radius
        size = np.minimum(np.abs(edge), 1)
        bend = np.minimum(size[:, None], np.sqrt(1 - size**2))
        corner = bend * size + _half_disk(size)[:, None] - _half_disk(bend)
        taps = np.diff(np.diff(corner * np.outer(np.sign(edge), np.sign(edge)), axis=0), axis=1)
        return cls(np.where(taps > 16 * EPS, taps, 0))  # a tap is the difference of four numbers below 1

    @classmethod
    def image(cls, picture: ArrayLike) -> Kernel:
        """Return the blur of a source that looks like a picture, (k, l).

        A side of an even number of pixels gets a dark pixel more at its end.
        """
        w = require_light("picture", picture)
        return cls(np.pad(w, [(0, 1 - side % 2) for side in w.shape]))

    @cached_property
    def taps(self) -> list[tuple[int, int, float]]:
        """The non-zero taps: row, column, weight."""
        return [(int(i), int(j), float(self.weights[i, j])) for i, j in np.argwhere(self.weights)]

    def light_shape(self, shape: tuple[int, ...]) -> tuple[int, int]:
        """Return the shape of the light that can reach an image of the given shape."""
        return (shape[0] + self.weights.shape[0] - 1, shape[1] + self.weights.shape[1] - 1)

    def apply(self, light: Real) -> Real:
        """Return the image E[y] = sum over t of w[t] F[y + (k - 1, l - 1) - t],
        ``scipy.signal.convolve(light, weights, "valid")``.

        light : (n + k - 1, m + l - 1).  Returns (n, m), in the precision of the light (float32 or float64).

        Raises ValueError : light that is smaller than the kernel.
        """
        k, l = self.weights.shape
        n, m = light.shape[0] - k + 1, light.shape[1] - l + 1
        if n < 1 or m < 1:
            raise ValueError(
                f"the light must not be smaller than the kernel, {k} x {l} taps, got shape {light.shape}"
            )
        if len(self.taps) <= FEW_TAPS:
            image = np.zeros((n, m), light.dtype)
            for i, j, weight in self.taps:
                image += weight * light[k - 1 - i : k - 1 - i + n, l - 1 - j : l - 1 - j + m]
            return image
        transfer, size = _transfer(self, light.shape, light.dtype)
        return fft.irfft2(fft.rfft2(light, size) * transfer, size)[k - 1 : k - 1 + n, l - 1 : l - 1 + m]

    def adjoint(self, image: Real) -> Real:
        """Return A^T y, the correlation of an image with the kernel: <apply(f), y> = <f, adjoint(y)>.

        image : (n, m).  Returns (n + k - 1, m + l - 1).
        """
        k, l = self.weights.shape
        n, m = image.shape
        shape = self.light_shape(image.shape)
        if len(self.taps) <= FEW_TAPS:
            light = np.zeros(shape, image.dtype)
            for i, j, weight in self.taps:
                light[k - 1 - i : k - 1 - i + n, l - 1 - j : l - 1 - j + m] += weight * image
            return light
        transfer, size = _transfer(self, shape, image.dtype)
        placed = np.zeros(size, image.dtype)
        placed[k - 1 : k - 1 + n, l - 1 : l - 1 + m] = image
        return fft.irfft2(fft.rfft2(placed) * transfer.conj(), size)[: shape[0], : shape[1]]

    def greatest_mean(self, image: Floats) -> float:
        """Return a number that no A^T y / A^T 1 exceeds where A^T 1 > 0, rounding included, from 0 on.

        These quotients are weighted means of the pixels y.  A sum tap by tap errs by n_taps EPS max |y| of
        A^T 1, transforms by the same amount everywhere (`_transform_error`).  So the pixels of light that
        hardly meet the image are summed.  image : (n, m) float64.
        """
        sums = self.column_sums(image.shape)
        relative = len(self.taps) * EPS * float(np.abs(image).max())
        error = relative * sums
        light = self.adjoint(image)
        if len(self.taps) > FEW_TAPS:
            everywhere = _transform_error(self.weights, image)
            faint = np.argsort(np.where(sums > 0, sums, np.inf), axis=None)[:MOST_FAINT]
            rows, columns = np.unravel_index(faint, sums.shape)
            # A^T y at some pixels of light, tap by tap
            k, l = self.weights.shape
            padded = np.pad(image, [(k - 1, k - 1), (l - 1, l - 1)])
            total = np.zeros(len(rows))
            for i, j, weight in self.taps:
                total += weight * padded[rows + i, columns + j]
            light[rows, columns] = total
            error = np.where(np.isin(np.arange(sums.size), faint).reshape(sums.shape), error, everywhere)
        most = np.divide(light + error, sums, out=np.zeros_like(sums), where=sums > 0).max()
        # the sums of k l positive taps, and the last few operations
        return max(0.0, float(most)) * (1 + (sum(self.weights.shape) + 4) * EPS)

    def column_sums(self, shape: tuple[int, ...]) -> Floats:
        """Return A^T 1: the fraction of every pixel of light that falls on an image of this shape.

        Its sums have no cancellation.

        Raises ValueError : an image that is smaller than the kernel.
        """
        if any(side < taps for side, taps in zip(shape, self.weights.shape)):
            raise ValueError(
                f"the image must not be smaller than the kernel, got shapes {shape} and {self.weights.shape}"
            )
        return _window_sums(_window_sums(self.weights, shape[0]).T, shape[1]).T


def require_light(name: str, values: ArrayLike) -> Floats:
    """Return a non-negative image as floats.

    Raises ValueError : it has no two dimensions or no flux, or a pixel is negative or not finite.
    """
    image = np.asarray(values, dtype=np.float64)
    if image.ndim != 2 or image.size == 0:
        raise ValueError(f"{name} must be an image of rows and columns, got shape {image.shape}")
    if not np.isfinite(image).all() or (image < 0).any():
        bad = tuple(np.argwhere(~(np.isfinite(image) & (image >= 0)))[0].tolist())
        raise ValueError(f"{name} must be finite and not negative, got {image[bad]:g} at {bad}")
    if not image.any():
        raise ValueError(f"{name} must have some flux, got zeros only")
    return image


def _transform_error(weights: Floats, image: Floats) -> float:
    """Return a bound of the rounding errors of a convolution or correlation by fast Fourier transforms.

    A transform of N numbers errs by at most r = BUTTERFLY log2(N) u of its norm, u = EPS / 2.  With the
    errors of both factors, and of the way back with the product's,

        |error| <= r (2 ||y||_2 ||w||_1 + ||y||_1 ||w||_2).

    Source: N. Higham, Accuracy and Stability of Numerical Algorithms, section 24.1.
    """
    size = np.prod([fft.next_fast_len(n + k - 1, real=True) for n, k in zip(image.shape, weights.shape)])
    y, w = np.abs(image), np.abs(weights)
    most = 2 * np.sqrt((y**2).sum()) * w.sum() + y.sum() * np.sqrt((w**2).sum())
    return float((BUTTERFLY * np.log2(size) + 8) * EPS / 2 * 1.01 * most)


def _window_sums(taps: Floats, side: int) -> Floats:
    """Return for light x the sum of the taps t of its column with 0 <= x + t - (k - 1) < side.

    taps : (k, l).  Returns (side + k - 1, l).
    """
    first, last = np.cumsum(taps[::-1], axis=0), np.cumsum(taps, axis=0)
    return np.concatenate([first[:-1], np.repeat(first[-1:], side - len(taps) + 1, axis=0), last[-2::-1]])


def _edges(half: float) -> Floats:
    if not (np.isfinite(half) and half > 0):
        raise ValueError(f"a half width or radius must be a positive number of pixels, got {half}")
    middle = int(np.ceil(half - 0.5))
    return np.arange(-middle, middle + 2, dtype=np.float64) - 0.5


def _covered(half: float) -> Floats:
    return np.diff(np.clip(_edges(half), -half, half))


def _half_disk(u: Floats) -> Floats:
    """Return the integral of sqrt(1 - t^2) from 0 to u."""
    return (u * np.sqrt(1 - u**2) + np.arcsin(u)) / 2


@lru_cache(maxsize=2)
def _transfer(
    kernel: Kernel, shape: tuple[int, ...], precision: np.dtype[np.floating]
) -> tuple[NDArray[np.complexfloating], tuple[int, int]]:
    size = (fft.next_fast_len(shape[0], real=True), fft.next_fast_len(shape[1], real=True))
    return fft.rfft2(kernel.weights.astype(precision), size), size
