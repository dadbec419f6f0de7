"""The best non-negative light for a source: min ||E * F - G|| over F >= 0, with a certificate of its quality.

Source: thesis 7.31-7.34 with shifted Kronecker deltas as basis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from optics.etendue.certificate import gradient, kkt_residual, lower_bound, norm
from optics.etendue.kernel import Array, Kernel, require_light
from optics.etendue.nonnegative_solvers import descend, split
from thbcad.checks import read_only, require_integer, require_number

SINGLE = 1e-5  # up to this KKT residual single precision is enough: its rounding errors are a hundredth of it

SPLIT = 200  # steps of the splitting, after which those of the gradient method converge fast


@dataclass(frozen=True, eq=False)
class Approximation:
    """Light F >= 0 whose image E * F is near a target G.

    solution : (n + k - 1, m + l - 1), F in the unit of the target; light beyond the border may reach the
        image too
    image : (n, m), E * F
    residual : ||E * F - G|| / ||G||
    lower_bound : no light F >= 0 has a residual below this
    kkt : the relative KKT residual, see `optics.etendue.certificate.kkt_residual`
    iterations : steps of the solver
    """

    solution: Array
    image: Array
    residual: float
    kkt: float
    lower_bound: float
    iterations: int

    @property
    def light(self) -> Array:
        """The pixels of F above those of the image, (n, m)."""
        (i, j), (n, m) = (np.subtract(self.solution.shape, self.image.shape) // 2, self.image.shape)
        return self.solution[i : i + n, j : j + m]


def approximate(
    kernel: Kernel, target: ArrayLike, tolerance: float = 1e-5, most_iterations: int = 5000
) -> Approximation:
    """Return light F >= 0 that minimises ||E * F - G||^2, with its certificate.

    target : (n, m), G >= 0, not smaller than the kernel.  Light that misses the image counts neither way.
    tolerance : of the relative KKT residual; where `most_iterations` steps do not reach it,
        `Approximation.kkt` tells.

    Splitting, then gradient steps in single precision, then in double precision, see
    `optics.etendue.nonnegative_solvers`.

    Raises
    ------
    ValueError : a target that is negative, not finite, dark or smaller than the kernel; a tolerance that is
        not positive.
    """
    goal = require_target(kernel, target)
    require_number("tolerance", tolerance, above=0.0)
    require_integer("most_iterations", most_iterations, 1)
    top = goal.max()
    coarse = (goal / top).astype(np.float32)
    start = gradient(
        kernel,
        np.zeros(kernel.light_shape(goal.shape), np.float32),
        -coarse,
        kernel.reach(goal.shape).astype(np.float32),
    )
    steps = min(SPLIT, most_iterations)
    light, single = descend(
        kernel, split(kernel, start, coarse, steps), coarse, max(tolerance, SINGLE), most_iterations - steps
    )
    light, double = descend(
        kernel, light.astype(np.float64), goal / top, tolerance, most_iterations - steps - single
    )
    return certified(kernel, top * light, goal, steps + single + double)


def certified(kernel: Kernel, light: Array, target: Array, iterations: int) -> Approximation:
    """Return light F >= 0 with its certificate.  light : (n + k - 1, m + l - 1).  target : (n, m)."""
    image = kernel.apply(light)
    error = target - image
    residual = norm(error) / norm(target)
    bound = min(residual, lower_bound(kernel, target, error))
    return Approximation(
        read_only(light), read_only(image), residual, kkt_residual(kernel, light, target), bound, iterations
    )


def require_target(kernel: Kernel, target: ArrayLike) -> Array:
    """Return the target as floats, or raise a ValueError that says why a kernel has no approximation of
    it."""
    goal = require_light("target", target)
    if any(side < taps for side, taps in zip(goal.shape, kernel.weights.shape)):
        raise ValueError(
            f"the target must not be smaller than the kernel, got shapes {goal.shape} and "
            f"{kernel.weights.shape}"
        )
    return goal
