"""What certifies a non-negative approximation: its KKT residual and a lower bound of the optimum.

Write A for the blur, g > 0 for the target, d for the least distance of g from {A f : f >= 0}, s = A^T 1 for
the fraction of every pixel of light that falls on the image.  At the optimum min(f, A^T (A f - g)) = 0.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter

from optics.designing.etendue.kernel import Blur, PixelBlur, Real
from thbcad.checks import EPS, Floats


def gradient(blur: Blur, light: Real, target: Real, sums: Real) -> Real:
    """Return A^T (A f - g) / s, the blurred error as light; 0 where no light falls on the image (s = 0)."""
    return per_column_sum(blur.adjoint(blur.apply(light) - target), sums)


def per_column_sum(light: Real, sums: Real) -> Real:
    """Return light / s, and 0 where s = 0; s = A^T 1."""
    return np.divide(light, sums, out=np.zeros_like(light), where=sums > 0)


def kkt_residual(blur: Blur, light: Real, target: Floats) -> float:
    """Return ||min(f, D A^T (A f - g))|| / ||D A^T g|| with D = 1 / s, in the norm ||f||^2 = sum s f^2.

    It is 1 for f = 0 and 0 at the optimum, and does not change with the unit of g.
    """
    sums = blur.column_sums(target.shape)
    error = np.minimum(light, gradient(blur, light, target, sums))
    scale = gradient(blur, np.zeros_like(light), target, sums)
    return float(np.sqrt((sums * error**2).sum() / (sums * scale**2).sum()))


def lower_bound(blur: PixelBlur, target: Floats, residual: Real) -> float:
    """Return a number that d / ||g|| is not below, from the residual g - A f of any f, (n, m).

    For the optimal f, with e = g - A f, d = ||e||, and any y with A^T y <= delta s, delta >= 0:

        <y, g> = <y, e> + <A^T y, f> <= ||y|| d + delta <s, f>,   <s, f> = <1, A f> <= sqrt(n m) ||g||

    because A f is the projection of g on a convex cone: ||A f|| <= ||g||.  So
    d >= (<y, g> - delta sqrt(n m) ||g||) / ||y||.  Here y is the residual less a correction that makes delta
    = 0 up to rounding, which `greatest_mean` bounds: with q = max(0, A^T residual / s), c[i] = max of q over
    the pixels whose blur reaches i gives A^T c >= s q, and so does the greatest q everywhere.  The better of
    the two counts; y = 0 gives 0.

    Source: weak duality; S. Boyd and L. Vandenberghe, Convex Optimization, 5.2.
    """
    sums = blur.column_sums(target.shape)
    excess = np.maximum(per_column_sum(blur.adjoint(residual), sums), 0)
    (k, l), (n, m) = blur.weights.shape, target.shape
    # the light of pixel (i, j) of the image is centred on (i + k // 2, j + l // 2)
    near = maximum_filter(excess, (k, l), mode="constant")[k // 2 : k // 2 + n, l // 2 : l // 2 + m]
    return max(bound_by(blur, target, residual - c) for c in (near, excess.max()))


def scaled_bound(blur: Blur, target: Floats, residual: Real) -> float:
    """Return the bound of `lower_bound` for any non-negative linear map, corrected by the greatest q only.

    It holds but for the rounding of A^T y, which is not known of every map.
    """
    sums = blur.column_sums(target.shape)
    y = residual - max(0.0, per_column_sum(blur.adjoint(residual), sums).max())
    return _bound(target, y, max(0.0, float(per_column_sum(blur.adjoint(y), sums).max())))


def bound_by(blur: PixelBlur, target: Floats, y: Floats) -> float:
    """Return the bound of `lower_bound` for one y, rounding included."""
    return _bound(target, y, blur.greatest_mean(y))


def _bound(target: Floats, y: Real, delta: float) -> float:
    """Return (<y, g> / ||g|| - delta sqrt(n m)) / ||y||, rounded towards 0 by all that its sums can err."""
    error = y.size * EPS  # of a sum of positive terms in any order
    along = float((y * target).sum() - error * np.abs(y * target).sum())
    size, goal = norm(y) * (1 + error), norm(target) * (1 + error)
    if size == 0:
        return 0.0
    bound = (along / goal - delta * np.sqrt(y.size) * (1 + 4 * EPS)) / size
    return max(0.0, float(bound) * (1 - 8 * EPS))


def norm(image: Real) -> float:
    """Return the square root of the sum of squares.

    It runs on one core, unlike `numpy.linalg.norm`, whose BLAS takes several.
    """
    return float(np.sqrt(np.square(image).sum()))
