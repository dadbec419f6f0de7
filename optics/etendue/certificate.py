"""What certifies a non-negative approximation: its KKT residual and a lower bound of the optimum.

Write A for the blur, g > 0 for the target, d for the least distance of g from {A f : f >= 0}, s = A^T 1 for
the share of every pixel of light that falls on the image.  At the optimum min(f, A^T (A f - g)) = 0.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter

from optics.etendue.kernel import Array, Blur, Kernel, Real


def gradient(kernel: Blur, light: Real, target: Real, reach: Real) -> Real:
    """Return A^T (A f - g) / s, the blurred error as light, 0 where the image is out of reach (s = 0)."""
    error = kernel.adjoint(kernel.apply(light) - target)
    return np.divide(error, reach, out=np.zeros_like(error), where=reach > 0)


def kkt_residual(kernel: Blur, light: Array, target: Array) -> float:
    """Return ||min(f, D A^T (A f - g))|| / ||D A^T g|| with D = 1 / s, in the norm ||f||^2 = sum s f^2.

    It is 1 for f = 0 and 0 at the optimum, and does not change with the unit of g.
    """
    reach = kernel.reach(target.shape)
    error = np.minimum(light, gradient(kernel, light, target, reach))
    scale = gradient(kernel, np.zeros_like(light), target, reach)
    return float(np.sqrt((reach * error**2).sum() / (reach * scale**2).sum()))


def lower_bound(kernel: Kernel, target: Array, residual: Array) -> float:
    """Return a number that d / ||g|| is not below, from the residual g - A f of any f, (n, m).

    For the optimal f, with e = g - A f, d = ||e||, and any y with A^T y <= delta s, delta >= 0:

        <y, g> = <y, e> + <A^T y, f> <= ||y|| d + delta <s, f>,   <s, f> = <1, A f> <= sqrt(n m) ||g||

    because A f is the projection of g on a convex cone: ||A f|| <= ||g||.  So
    d >= (<y, g> - delta sqrt(n m) ||g||) / ||y||.  Here y is the residual less a correction that makes delta
    = 0 up to rounding: with q = max(0, A^T residual / s), c[i] = max of q over the pixels whose blur reaches
    i gives A^T c >= s q, and so does the greatest q everywhere.  The better of the two counts; y = 0 gives 0.

    Source: weak duality; S. Boyd and L. Vandenberghe, Convex Optimization, 5.2.
    """
    reach = kernel.reach(target.shape)
    excess = np.maximum(_per_reach(kernel.adjoint(residual), reach), 0)
    near = maximum_filter(excess, kernel.weights.shape, mode="constant")
    (k, l), (n, m) = kernel.weights.shape, target.shape
    near = near[k // 2 : k // 2 + n, l // 2 : l // 2 + m]
    return max(_bound(kernel, target, residual - c) for c in (near, excess.max()))


def scaled_bound(blur: Blur, target: Array, residual: Array) -> float:
    """Return the bound of `lower_bound` for any non-negative linear map, corrected by the greatest q only."""
    excess = max(0.0, _per_reach(blur.adjoint(residual), blur.reach(target.shape)).max())
    return _bound(blur, target, residual - excess)


def _bound(blur: Blur, target: Array, y: Array) -> float:
    size = norm(y)
    if size == 0:
        return 0.0
    delta = max(0.0, _per_reach(blur.adjoint(y), blur.reach(target.shape)).max())
    return max(0.0, float(((y * target).sum() / norm(target) - delta * np.sqrt(y.size)) / size))


def norm(image: Array) -> float:
    """Return the square root of the sum of squares, on one core, which the BLAS of `numpy.linalg.norm` does
    not keep to."""
    return float(np.sqrt(np.square(image).sum()))


def _per_reach(light: Array, reach: Array) -> Array:
    return np.divide(light, reach, out=np.zeros_like(light), where=reach > 0)
