"""Richardson-Lucy deconvolution with a known and with an unknown source: the baselines of thesis 7.2.

Both minimise the Kullback-Leibler divergence of the image from the target by factors, which keeps the light
non-negative.

Source: W. Richardson, JOSA 62 (1972); L. Lucy, Astron. J. 79 (1974); D. Fish et al., JOSA A 12 (1995), blind
(7.8).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import fftconvolve

from optics.designing.etendue import (
    Approximation,
    Kernel,
    Real,
    certified,
    per_column_sum,
    require_target,
)
from thbcad.checks import Floats, require_integer


def richardson_lucy(kernel: Kernel, target: ArrayLike, steps: int) -> Approximation:
    """Return the light after steps F <- F A^T (G / A F) / A^T 1, from uniform light, with its certificate.

    target : (n, m)
    """
    goal = require_target(kernel, target)
    require_integer("steps", steps, 1)
    light: Real = np.full(kernel.light_shape(goal.shape), goal.mean())
    for _ in range(steps):
        light = light * _factor(kernel, light, goal)
    return certified(kernel, light, goal, steps)


def blind_deconvolution(
    start: Kernel, target: ArrayLike, rounds: int, steps: int = 5
) -> tuple[Kernel, Approximation]:
    """Return a source and light whose image is near the target, by alternating Richardson-Lucy steps (7.8).

    start : the first guess of the source; its zeros stay zeros
    rounds : of `steps` steps in the light, then in the source

    A point stays a point, and then the light becomes the target: the trivial solution.
    """
    goal = require_target(start, target)
    require_integer("rounds", rounds, 1)
    require_integer("steps", steps, 1)
    kernel = start
    light: Real = np.full(start.light_shape(goal.shape), goal.mean())
    for _ in range(rounds):
        for _ in range(steps):
            light = light * _factor(kernel, light, goal)
        for _ in range(steps):
            kernel = Kernel(kernel.weights * _source_factor(kernel, light, goal))
    return kernel, certified(kernel, light, goal, rounds * steps)


def _factor(kernel: Kernel, light: Real, target: Floats) -> Real:
    sums = kernel.column_sums(target.shape)
    back = np.maximum(kernel.adjoint(_ratio(kernel, light, target)), 0)
    return per_column_sum(back, sums)


def _source_factor(kernel: Kernel, light: Real, target: Floats) -> Floats:
    """Return the factors of the taps, (k, l): the correlation of the light with G / A F, over that with 1."""
    seen = [
        fftconvolve(light, image[::-1, ::-1], "valid")[::-1, ::-1]
        for image in (_ratio(kernel, light, target), np.ones(target.shape))
    ]
    return np.maximum(seen[0], 0) / np.maximum(seen[1], np.finfo(np.float64).tiny)


def _ratio(kernel: Kernel, light: Real, target: Floats) -> Floats:
    image = kernel.apply(light)
    return np.divide(target, image, out=np.zeros_like(target), where=image > 0)
