"""Several blurs at once: parts of the light with a different blur each (thesis 7.5).

Such are systems that are not shift-invariant.  With light F_k >= 0 for each of K kernels w_k the image is the
mean

    E = 1 / K  sum over k of w_k * F_k.

Everything that is made of shifted copies of these kernels, with any weights, is such a mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import maximum_filter

from optics.designing.etendue.approximation import Approximation, approximate
from optics.designing.etendue.certificate import bound_by, per_column_sum
from optics.designing.etendue.kernel import Kernel, Real
from thbcad.checks import Floats


@dataclass(frozen=True, eq=False)
class KernelStack:
    """Kernels of one shape (k, l), as one `PixelBlur`.

    The lights for an image of (n, m) lie on top of each other, (K (n + k - 1), m + l - 1).

    Raises ValueError : no kernel, or kernels of different shapes.
    """

    kernels: tuple[Kernel, ...]

    def __post_init__(self) -> None:
        shapes = {kernel.weights.shape for kernel in self.kernels}
        if len(shapes) != 1:
            raise ValueError(f"a stack must hold kernels of one shape, got {sorted(shapes)}")

    @classmethod
    def boxes(cls, rows: int, columns: int) -> KernelStack:
        """Return the boxes of rows or rows + 1 by columns or columns + 1 whole pixels.

        A uniform rectangle whose sides lie between, anywhere on the pixels, is a mean of shifted copies of
        these four.  For the interval [a, b] covers the fraction of the pixel [i, i + 1] that the t in [0, 1)
        with a <= i + t < b make up, and for each t these i are floor(b - a) or one more neighbouring pixels.
        """
        shape = rows + 1 + rows % 2, columns + 1 + columns % 2
        sides = [(a, b) for a in (rows, rows + 1) for b in (columns, columns + 1)]
        return cls(
            tuple(Kernel(np.pad(np.ones(s), [(0, n - side) for n, side in zip(shape, s)])) for s in sides)
        )

    @property
    def weights(self) -> Floats:
        """The mean of the kernels, (k, l)."""
        return np.mean([kernel.weights for kernel in self.kernels], axis=0)

    def light_shape(self, shape: tuple[int, ...]) -> tuple[int, int]:
        """Return the shape of the lights that can reach an image of the given shape."""
        rows, columns = self.kernels[0].light_shape(shape)
        return len(self.kernels) * rows, columns

    def apply(self, light: Real) -> Real:
        """Return the image (n, m) of lights as `light_shape`, in their precision."""
        each = light.reshape(len(self.kernels), -1, light.shape[1])
        k, l = self.kernels[0].weights.shape
        n, m = each.shape[1] - k + 1, each.shape[2] - l + 1
        transfers, size = _transfers(self, each.shape[1:], light.dtype)
        image = fft.irfft2((fft.rfft2(each, size) * transfers).sum(axis=0), size)
        return image[k - 1 : k - 1 + n, l - 1 : l - 1 + m]

    def adjoint(self, image: Real) -> Real:
        """Return A^T y: <apply(f), y> = <f, adjoint(y)>.  image : (n, m).  Returns as `light_shape`."""
        k, l = self.kernels[0].weights.shape
        (n, m), (rows, columns) = image.shape, self.kernels[0].light_shape(image.shape)
        transfers, size = _transfers(self, (rows, columns), image.dtype)
        placed = np.zeros(size, image.dtype)
        placed[k - 1 : k - 1 + n, l - 1 : l - 1 + m] = image
        return fft.irfft2(fft.rfft2(placed) * transfers.conj(), size)[:, :rows, :columns].reshape(-1, columns)

    def greatest_mean(self, image: Floats) -> float:
        """Return a number that no A^T y / A^T 1 exceeds, rounding included: the greatest of the kernels'."""
        return max(kernel.greatest_mean(image) for kernel in self.kernels)

    def column_sums(self, shape: tuple[int, ...]) -> Floats:
        """Return A^T 1: the fraction of every pixel of light that falls on an image of this shape, over
        K."""
        return np.concatenate([kernel.column_sums(shape) for kernel in self.kernels]) / len(self.kernels)


def stack_approximation(
    stack: KernelStack, target: Floats, tolerance: float, most_iterations: int
) -> tuple[Approximation, float]:
    """Return (Approximation, lower bound of ||E - G|| / ||G||) for the images of a stack.

    The bound is that of `etendue.certificate`: y = e - c with e = G - E.  Here c[i] is the greatest of
    max(0, A^T e / A^T 1) over the pixels of all lights whose blur covers pixel i, so that A^T y <= 0 but for
    rounding, which delta holds.
    """
    # the splitting is made for one kernel and gains nothing here
    best = approximate(stack, target, tolerance, most_iterations, splitting=0)
    error = target - best.image
    sums = stack.column_sums(target.shape)
    each = per_column_sum(stack.adjoint(error), sums).reshape(len(stack.kernels), -1, sums.shape[1])
    excess = np.maximum(each.max(axis=0), 0)
    (k, l), (n, m) = stack.kernels[0].weights.shape, target.shape
    near = maximum_filter(excess, (k, l), mode="constant")[k // 2 : k // 2 + n, l // 2 : l // 2 + m]
    return best, float(np.clip(bound_by(stack, target, error - near), best.lower_bound, best.residual))


@lru_cache(maxsize=2)
def _transfers(
    stack: KernelStack, shape: tuple[int, ...], precision: np.dtype[np.floating]
) -> tuple[NDArray[np.complexfloating], tuple[int, int]]:
    size = (fft.next_fast_len(shape[0], real=True), fft.next_fast_len(shape[1], real=True))
    weights = np.stack([kernel.weights for kernel in stack.kernels]) / len(stack.kernels)
    return fft.rfft2(weights.astype(precision), size), size
