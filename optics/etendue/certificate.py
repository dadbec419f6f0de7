"""What certifies a non-negative approximation: its KKT residual and a lower bound of the optimum.

Write A for the blur, g > 0 for the target, d for the least distance of g from {A f : f >= 0}, s = A^T 1 for
the fraction of every pixel of light that falls on the image.  At the optimum min(f, A^T (A f - g)) = 0.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter

from optics.etendue.kernel import Array, Blur, PixelBlur, Real


def gradient(blur: Blur, light: Real, target: Real, sums: Real) -> Real:
    """Return A^T (A f - g) / s, the blurred error as light; 0 where no light falls on the image (s = 0)."""
    return per_column_sum(blur.adjoint(blur.apply(light) - target), sums)


def per_column_sum(light: Real, sums: Real) -> Real:
    """Return light / s, and 0 where s = 0; s = A^T 1."""
    return np.divide(light, sums, out=np.zeros_like(light), where=sums > 0)


def kkt_residual(blur: Blur, light: Real, target: Array) -> float:
    """Return ||min(f, D A^T (A f - g))|| / ||D A^T g|| with D = 1 / s, in the norm ||f||^2 = sum s f^2.

    It is 1 for f = 0 and 0 at the optimum, and does not change with the unit of g.
    """
    sums = blur.column_sums(target.shape)
    error = np.minimum(light, gradient(blur, light, target, sums))
    scale = gradient(blur, np.zeros_like(light), target, sums)
    return float(np.sqrt((sums * error**2).sum() / (sums * scale**2).sum()))


def lower_bound(blur: PixelBlur, target: Array, residual: Real) -> float:
    """Return a number that d / ||g|| is not below, from the residual g - A f of any f, (n, m).

    For the optimal f, with e = g - A f, d = ||e||, and any y with A^T y <= delta s, delta >= 0:

        <y, g> = <y, e> + <A^T y, f> <= ||y|| d + delta <s, f>,   <s, f> = <1, A f> <= sqrt(n m) ||g||

    because A f is the projection of g on a convex cone: ||A f|| <= ||g||.  So
    d >= (<y, g> - delta sqrt(n m) ||g||) / ||y||.  Here y is the residual less a correction that makes delta
    = 0 up to rounding: with q = max(0, A^T residual / s), c[i] = max of q over the pixels whose blur reaches
    i gives A^T c >= s q, and so does the greatest q everywhere.  The better of the two counts; y = 0 gives 0.

    Source: weak duality; S. Boyd and L. Vandenberghe, Convex Optimization, 5.2.
    """
    sums = blur.column_sums(target.shape)
    excess = np.maximum(per_column_sum(blur.adjoint(residual), sums), 0)
    (k, l), (n, m) = blur.weights.shape, target.shape
    # the light of pixel (i, j) of the image is centred on (i + k // 2, j + l // 2)
    near = maximum_filter(excess, (k, l), mode="constant")[k // 2 : k // 2 + n, l // 2 : l // 2 + m]
    return max(_bound(blur, target, residual - c) for c in (near, excess.max()))


def scaled_bound(blur: Blur, target: Array, residual: Real) -> float:
    """Return the bound of `lower_bound` for any non-negative linear map, corrected by the greatest q only."""
    excess = max(0.0, per_column_sum(blur.adjoint(residual), blur.column_sums(target.shape)).max())
    return _bound(blur, target, residual - excess)


def _bound(blur: Blur, target: Array, y: Real) -> float:
    size = norm(y)
    if size == 0:
        return 0.0
    delta = max(0.0, per_column_sum(blur.adjoint(y), blur.column_sums(target.shape)).max())
    return max(0.0, float(((y * target).sum() / norm(target) - delta * np.sqrt(y.size)) / size))


def norm(image: Real) -> float:
    """Return the square root of the sum of squares.

    It runs on one core, unlike `numpy.linalg.norm`, whose BLAS takes several.
    """
    return float(np.sqrt(np.square(image).sum()))
