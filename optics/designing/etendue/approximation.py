"""The best non-negative light F for a source E: min ||E * F - G|| over F >= 0, with its certificate.

Source: thesis 7.31-7.34 with shifted Kronecker deltas as basis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from optics.designing.etendue.certificate import gradient, kkt_residual, lower_bound, norm
from optics.designing.etendue.kernel import Array, PixelBlur, Real, require_light
from optics.designing.etendue.nonnegative_solvers import descend, split
from thbcad.checks import read_only, require_integer, require_number

SINGLE = 1e-5  # up to this KKT residual single precision is enough: its rounding errors are a hundredth of it

SPLIT = 200  # steps of the splitting, after which those of the gradient method converge fast


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

    Splitting, then gradient steps in single precision, then in double precision, see
    `optics.designing.etendue.nonnegative_solvers`.

    Raises
    ------
    ValueError : a target that is negative, not finite, dark or smaller than the kernel; a tolerance that is
        not positive.
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


def certified(blur: PixelBlur, light: Real, target: Array, iterations: int) -> Approximation:
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


def require_target(blur: PixelBlur, target: ArrayLike) -> Array:
    """Return the target as floats.

    Raises
    ------
    ValueError : it has no approximation: it is negative, not finite, dark or smaller than the kernel.
    """
    goal = require_light("target", target)
    if any(side < taps for side, taps in zip(goal.shape, blur.weights.shape)):
        raise ValueError(
            f"the target must not be smaller than the kernel, "
            f"got shapes {goal.shape} and {blur.weights.shape}"
        )
    return goal
