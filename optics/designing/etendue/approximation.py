"""The best non-negative light F for a source E: min ||E * F - G|| over F >= 0, with its certificate.

Two matrix-free solvers find it: one is fast at first, the other ends exactly.  Gradient steps are slow where
the kernel's transform is nearly 0; the splitting, which divides by the transform, is not.

Source: thesis 7.31-7.34 with shifted Kronecker deltas as basis.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from optics.designing.etendue.certificate import gradient, kkt_residual, lower_bound, norm
from optics.designing.etendue.kernel import Blur, PixelBlur, Real, require_light
from thbcad.checks import Floats, read_only, require_integer, require_number

SINGLE = 1e-5  # up to this KKT residual single precision is enough: its rounding errors are a hundredth of it

FAINT = 1e-6  # of the greatest share of light that falls on the image: rounding outweighs smaller ones
SPLIT = 200  # steps of the splitting, after which those of the gradient method converge fast
# of u = A f and of h = f, beside the curvature 1 of the loss: the speed depends on them
IMAGE_PENALTY = 0.1
LIGHT_PENALTY = 0.001
RELAXATION = 1.8


@dataclass(frozen=True, eq=False)
class Approximation:
    """Light F >= 0 whose image E * F is near a target G.

    solution : (n + k - 1, m + l - 1), F in the unit of the target; light beyond the border adds to the image
        too
    image : (n, m), E * F
    residual : ||E * F - G|| / ||G||
    lower_bound : no light F >= 0 has a residual below this
    kkt : the relative KKT residual, see `optics.designing.etendue.certificate.kkt_residual`
    iterations : steps of the solver
    """

    solution: Real
    image: Real
    residual: float
    kkt: float
    lower_bound: float
    iterations: int

    @property
    def light(self) -> Real:
        """The pixels of F above those of the image, (n, m)."""
        (i, j), (n, m) = (np.subtract(self.solution.shape, self.image.shape) // 2, self.image.shape)
        return self.solution[i : i + n, j : j + m]


def approximate(
    blur: PixelBlur,
    target: ArrayLike,
    tolerance: float = 1e-5,
    most_iterations: int = 5000,
    splitting: int = SPLIT,
) -> Approximation:
    """Return light F >= 0 that minimises ||E * F - G||^2, with its certificate.

    target : (n, m), G >= 0, not smaller than the kernel.  Light that misses the image does not count.
    tolerance : of the relative KKT residual; `most_iterations` steps may end above it, see
        `Approximation.kkt`
    splitting : steps of the splitting

    Splitting (`split`), then gradient steps (`descend`) in single precision, then in double precision.

    Raises ValueError : a target that is negative, not finite, dark or smaller than the kernel; a tolerance
        that is not positive.
    """
    goal = require_target(blur, target)
    require_number("tolerance", tolerance, above=0.0)
    require_integer("most_iterations", most_iterations, 1)
    top = goal.max()
    coarse = (goal / top).astype(np.float32)
    start = gradient(
        blur,
        np.zeros(blur.light_shape(goal.shape), np.float32),
        -coarse,
        blur.column_sums(goal.shape).astype(np.float32),
    )
    steps = min(splitting, most_iterations)
    light = split(blur, start, coarse, steps)
    light, single = descend(blur, light, coarse, max(tolerance, SINGLE), most_iterations - steps)
    left = most_iterations - steps - single
    light, double = descend(blur, light.astype(np.float64), goal / top, tolerance, left)
    return certified(blur, top * light, goal, steps + single + double)


def certified(blur: PixelBlur, light: Real, target: Floats, iterations: int) -> Approximation:
    """Return light F >= 0 with its certificate.  light : (n + k - 1, m + l - 1).  target : (n, m)."""
    image = blur.apply(light)
    error = target - image
    residual = norm(error) / norm(target)
    return Approximation(
        solution=read_only(light),
        image=read_only(image),
        residual=residual,
        kkt=kkt_residual(blur, light, target),
        lower_bound=min(residual, lower_bound(blur, target, error)),
        iterations=iterations,
    )


def require_target(blur: PixelBlur, target: ArrayLike) -> Floats:
    """Return the target as floats.

    Raises ValueError : it has no approximation: it is negative, not finite, dark or smaller than the kernel.
    """
    goal = require_light("target", target)
    if any(side < taps for side, taps in zip(goal.shape, blur.weights.shape)):
        raise ValueError(
            f"the target must not be smaller than the kernel, "
            f"got shapes {goal.shape} and {blur.weights.shape}"
        )
    return goal


def split(blur: PixelBlur, start: Real, target: Real, steps: int) -> Real:
    """Return light after some steps of the alternating direction method of multipliers.

    It splits ||M u - g||^2 / 2 + [h >= 0] with u = W f, h = f.  W is the circular convolution on a grid with
    room for all light, M takes the image from it.  The step in f is diagonal after Fourier transform, those
    in u and h are pixelwise.

    start : light, in the precision of the target, of which 1 is the greatest value

    Source: S. Boyd et al., Found. Trends Mach. Learn. 3 (2011), 3.4.3 for the over-relaxation;
    M. Almeida and M. Figueiredo, IEEE Trans. Image Process. 22 (2013), for u and M.
    """
    (k, l), shape = blur.weights.shape, start.shape
    size = (fft.next_fast_len(shape[0], real=True), fft.next_fast_len(shape[1], real=True))
    transfer = fft.rfft2(blur.weights.astype(target.dtype), size)
    curvature = IMAGE_PENALTY * np.abs(transfer) ** 2 + LIGHT_PENALTY
    seen, goal, lit, h = (np.zeros(size, target.dtype) for _ in range(4))
    window = (slice(k - 1, k - 1 + target.shape[0]), slice(l - 1, l - 1 + target.shape[1]))
    seen[window], goal[window] = 1, target
    lit[: shape[0], : shape[1]] = blur.column_sums(target.shape) > 0
    h[: shape[0], : shape[1]] = start
    u = fft.irfft2(transfer * fft.rfft2(h), size)
    du, dh = np.zeros_like(u), np.zeros_like(h)
    for _ in range(steps):
        spectrum = transfer.conj() * fft.rfft2(u - du) * IMAGE_PENALTY + fft.rfft2(h - dh) * LIGHT_PENALTY
        spectrum /= curvature
        f = RELAXATION * fft.irfft2(spectrum, size) + (1 - RELAXATION) * h + dh
        v = RELAXATION * fft.irfft2(transfer * spectrum, size) + (1 - RELAXATION) * u + du
        u = (goal + IMAGE_PENALTY * v) / (seen + IMAGE_PENALTY)
        h = lit * np.maximum(f, 0)
        du, dh = v - u, f - h
    return h[: shape[0], : shape[1]]


def descend(blur: Blur, light: Real, target: Real, tolerance: float, most: int) -> tuple[Real, int]:
    """Return light f >= 0 after steps of the optimised projected gradient method, and their number.

    The plain step is x -> max(0, x - D A^T (A x - g)) with D = 1 / A^T 1.  No step size is to be chosen:
    D A^T A has no eigenvalue above 1, because A D A^T 1 = A 1 <= 1 and all entries are non-negative.  The
    method starts again from the plain step where its momentum points uphill.

    light, target : in the same precision, in which the steps are made
    tolerance : of the KKT residual ||min(f, D A^T (A f - g))|| / ||D A^T g||, norms weighted by A^T 1

    Source: A. Taylor, J. Hendrickx and F. Glineur, SIAM J. Optim. 27 (2017), 4.3; D. Kim and J. Fessler,
    J. Optim. Theory Appl. 178 (2018), for the restart.
    """
    sums = blur.column_sums(target.shape).astype(target.dtype)
    sums = np.where(sums > FAINT * sums.max(), sums, 0)  # light elsewhere hardly falls on the image
    blurred = gradient(blur, np.zeros_like(light), target, sums)
    enough = tolerance**2 * (sums * blurred**2).sum()
    x, slope = light, gradient(blur, light, target, sums)
    plain, ahead, theta, gamma = x, x, 1.0, 1.0
    for step in range(most):
        error = np.minimum(x, slope)
        if (sums * error**2).sum() <= enough:
            return x, step
        new = x - slope
        change = new - plain
        then = (1 + sqrt(1 + 4 * theta**2)) / 2
        # the point ahead of the projection: momentum along the steps, and a correction for the last
        # projection
        ahead = (
            new
            + ((theta - 1) / then) * change
            - (theta / then) * slope
            + ((theta - 1) / (gamma * then)) * (ahead - x)
        )
        theta, gamma = then, (2 * theta + then - 1) / then
        projected = np.maximum(ahead, 0)
        if (sums * (slope + (ahead - projected) / gamma) * change).sum() > 0:
            theta, gamma = 1.0, 1.0
        x, plain = projected, new
        slope = gradient(blur, x, target, sums)
    return x, most
