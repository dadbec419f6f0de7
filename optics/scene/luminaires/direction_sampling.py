"""Directions of a luminaire's light from two quantiles, by the exact inverse of its distribution.

The flux within gamma is a function of gamma alone: the mean over C is piecewise linear in gamma.  On an
interval with the intensities p and q at its ends a and b it is

    F(gamma) = p (cos a - cos gamma) + (q - p) (sin gamma - sin a - (gamma - a) cos gamma) / (b - a),

which Newton's method inverts.  At that gamma the intensity is piecewise linear in C, and its integral, a
quadratic function, is inverted in closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from optics.scene.luminaires.intensity_record import Luminaire, directions_at, interval_halves
from thbcad.checks import Floats, Integers

STEPS = 6  # of Newton's method; three reach the last digit but near angles without light
ROUNDING = 1e-15  # of an interval's flux: smaller differences are rounding errors
TINY = np.finfo(np.float64).tiny


class DirectionSampler:
    """Directions in which a luminaire shines, each for the same part of the flux.

    light : the Luminaire.
    """

    def __init__(self, luminaire: Luminaire) -> None:
        self.light = luminaire
        self._planes, self._gammas = np.radians(luminaire.planes), np.radians(luminaire.gammas)

    def __call__(self, u: Floats, v: Floats) -> Floats:
        """Return the directions at quantiles u of gamma and v of C, (n,) each, in [0, 1): (3, n)."""
        j, gamma = self._gamma(u)
        a, b = self._gammas[j], self._gammas[j + 1]
        t = np.clip((gamma - a) / (b - a), 0.0, 1.0)
        candela, sums, widths = self.light.candela, self._sums, np.diff(self._planes)

        def at(rows: Floats, i: Integers) -> Floats:
            return (1 - t) * rows[i, j] + t * rows[i, j + 1]

        wanted = v * at(sums, np.full(len(v), len(widths)))
        i = _last_not_above(lambda k: at(sums, k), wanted, len(widths))
        p, q = at(candela, i), at(candela, i + 1)
        part = np.maximum(at(sums, i + 1) - at(sums, i), TINY)
        inside = _linear_quantile(p, q, np.clip((wanted - at(sums, i)) / part, 0.0, 1.0))
        return directions_at(np.degrees(self._planes[i] + widths[i] * inside), np.degrees(gamma))

    @cached_property
    def _of_gamma(self) -> tuple[Floats, Floats]:
        """The mean over C at every gamma, and the flux of every interval of gamma, but for the full turn."""
        mean = interval_halves(self._planes) @ self.light.candela / self._planes[-1]
        a, b = self._gammas[:-1], self._gammas[1:]
        return mean, _flux_to(b, a, b, mean[:-1], mean[1:])

    def _gamma(self, u: Floats) -> tuple[Integers, Floats]:
        """Return the interval and the angle, radians, at quantiles of gamma."""
        mean, each = self._of_gamma
        ends = np.append(0.0, np.cumsum(each))
        wanted = u * ends[-1]
        j = np.clip(np.searchsorted(ends, wanted, side="right") - 1, 0, len(each) - 1)
        a, b, p, q = self._gammas[j], self._gammas[j + 1], mean[j], mean[j + 1]
        wanted = wanted - ends[j]
        depth = np.cos(a) - np.cos(b)  # the intensity is nearly linear in cos(gamma) too: where to start
        part = _linear_quantile(p, q, wanted / np.maximum(each[j], TINY))
        gamma = np.arccos(np.clip(np.cos(a) - depth * part, -1.0, 1.0))
        for _ in range(STEPS):
            density = (p + (q - p) * (gamma - a) / (b - a)) * np.sin(gamma)
            excess = _flux_to(gamma, a, b, p, q) - wanted
            excess = np.where(np.abs(excess) > ROUNDING * each[j], excess, 0.0)
            gamma = np.clip(gamma - excess / np.where(density > 0, density, np.inf), a, b)
        return j, gamma

    @cached_property
    def _sums(self) -> Floats:
        """The integrals of the intensity over C up to every plane, at every gamma, (k, m)."""
        light = self.light.candela
        each = np.diff(self._planes)[:, None] * (light[1:] + light[:-1]) / 2
        return np.vstack([np.zeros(light.shape[1]), np.cumsum(each, axis=0)])


def _flux_to(gamma: Floats, a: Floats, b: Floats, p: Floats, q: Floats) -> Floats:
    """Return F(gamma) on the interval from a to b."""
    tilted = np.sin(gamma) - np.sin(a) - (gamma - a) * np.cos(gamma)
    return p * (np.cos(a) - np.cos(gamma)) + (q - p) * tilted / (b - a)


def _linear_quantile(p: Floats, q: Floats, part: Floats) -> Floats:
    """Return s in [0, 1] below which there is a part of the integral of p + (q - p) s.

    part (p + q) = 2 p s + (q - p) s^2, solved without cancellation.
    """
    total = part * (p + q)
    root = np.sqrt(np.maximum(p * p + (q - p) * total, 0.0))
    return np.minimum(total / np.maximum(p + root, TINY), 1.0)


def _last_not_above(sums: Callable[[Integers], Floats], wanted: Floats, count: int) -> Integers:
    """Return the last k < count with sums(k) <= wanted, by bisection for all numbers at once."""
    low, high = np.zeros(len(wanted), np.int64), np.full(len(wanted), count)
    for _ in range(count.bit_length()):
        middle = (low + high) // 2
        under = sums(middle) <= wanted
        low, high = np.where(under, middle, low), np.where(under, high, middle)
    return low
