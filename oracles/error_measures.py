"""Relative errors, observed orders of convergence, and gradients held against differences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

DIRECTIONS = 20  # in which a gradient is held against differences
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Point:
    """One run.  rays : number.  seconds, gradient_seconds : of the irradiance, of loss and gradient.

    error, gradient_error : relative L2; NaN where the method has none.  megabytes : that the gradient's run
        adds to the process.
    """

    case: str
    method: str
    rays: int
    seconds: float
    error: float
    gradient_seconds: float
    gradient_error: float
    megabytes: float


def slope_of_fit(image: Floats, target: Floats) -> Floats:
    """Return the derivative of ||E - T||^2 / ||T||^2 by E."""
    return 2 * (image - target) / np.square(target).sum()


def relative(values: Floats, exact: Floats) -> float:
    """Return ||values - exact|| / ||exact||."""
    return float(np.linalg.norm(values - exact) / np.linalg.norm(exact))


def observed_order(rays: list[int], errors: list[float], least: float) -> float:
    """Return k of error ~ rays^-k by a straight line through the logarithms of the errors above `least`; NaN
    for fewer than two."""
    pairs = [(n, e) for n, e in zip(rays, errors) if np.isfinite(e) and e > least]
    if len(pairs) < 2:
        return np.nan
    return -float(np.polyfit(*np.log(pairs).T, 1)[0])


def seconds_at(points: list[Point], error: float) -> float:
    """Return the run time at which a method reaches an error of the irradiance, between its points on log-log
    scales.

    Where already its quickest point is better, that one's time; inf where none is.
    """
    before = None
    for p in points:
        if p.error <= error:
            if before is None:
                return p.seconds
            share = np.log(before.error / error) / np.log(before.error / p.error)
            return float(before.seconds * (p.seconds / before.seconds) ** share)
        before = p
    return np.inf


def worst_difference(
    loss: Callable[[Floats], float], at: Floats, gradient: Floats, step: float, smooth: bool = True
) -> float:
    """Return the greatest |slope - g . d| / |g| over random directions d of unit root mean square g . d /
    |g|.

    slope : the fourth-order central difference (8 (L(h) - L(-h)) - (L(2 h) - L(-2 h))) / (12 h), h in mm.
    smooth : False where the second derivative jumps: slope is then the nearer one, (L(h) - L(-h)) / (2 h).
    """
    rng, errors = np.random.default_rng(1), []
    for _ in range(DIRECTIONS):
        d = rng.standard_normal(len(at))
        near, far = (loss(at + k * step * d) - loss(at - k * step * d) for k in (1, 2))
        slope = (8 * near - far) / (12 * step) if smooth else near / (2 * step)
        errors.append(abs(slope - gradient @ d))
    return max(errors) / float(np.linalg.norm(gradient))


def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float:
    """Return k of seconds ~ sizes^k by a straight line through the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])
