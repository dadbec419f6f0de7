"""Windows in which irradiance is measured (thesis 2.35-2.38), in units of pixels.

The irradiance of pixel k is E_k = sum over rays of flux * W(q - c_k) / pixel area, with q the
landing point and c_k = k + 1/2 the pixel's centre in pixel units.  Windows are products of a
function of x and one of y, with unit integral, so that the sum of E over the pixels times the
pixel area is the flux.

The same window must be applied to the target: `filter_image` gives the exact measurement of an
irradiance that is constant on every pixel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, erf, exp, pi, sqrt
from typing import Protocol

import numpy as np
from scipy.ndimage import correlate1d

from optics.base.runtime import DrArray
from thbcad.checks import Floats


class Window(Protocol):
    """A measurement window W(x) W(y): what `Splat` and `filter_image` need of it."""

    @property
    def taps(self) -> int:
        """Number of pixels, in one direction, on which a point can have weight."""
        ...

    def weights(self, t: DrArray, exponential: Callable[[DrArray], DrArray], /) -> list[DrArray]:
        """Return the weights of the taps for a point at distance t, in [0, 1), past the first tap's cell."""
        ...

    def response(self) -> Floats:
        """Return the integrals of W over the pixels around its centre, (an odd number,)."""
        ...


@dataclass(frozen=True)
class BoxWindow:
    """W = 1 on the pixel, the radiometric definition (2.35).  Not differentiable."""

    taps = 1

    def weights(self, t: DrArray, exponential: Callable[[DrArray], DrArray]) -> list[DrArray]:
        return [1.0]

    def response(self) -> Floats:
        return np.array([1.0])


@dataclass(frozen=True)
class BSplineWindow:
    """W = uniform B-spline of the given degree, as wide as degree + 1 pixels.

    C^(degree - 1) and an exact partition of unity over the pixels.
    """

    degree: int = 3

    @property
    def taps(self) -> int:
        return self.degree + 1

    def weights(self, t: DrArray, exponential: Callable[[DrArray], DrArray] | None = None) -> list[DrArray]:
        """Return M_p(t + p - r), r = 0..p, for t in [0, 1)."""
        return cardinal_weights(t, self.degree)

    def response(self) -> Floats:
        # a box convolved with M_p is M_(p+1); its values at whole distances from the centre
        values = cardinal_weights(0.0 if self.degree % 2 == 0 else 0.5, self.degree + 1)
        return np.array([v for v in values if v > 0])


@dataclass(frozen=True)
class PixelWindow:
    """W = the pixel convolved with the bump 15/16 (1 - s^2)^2 of half-width `blur` pixels, at most 1/2.

    C^2, an exact partition of unity over the pixels, and close to the radiometric definition.
    """

    blur: float = 0.3
    taps = 2

    def weights(self, t: DrArray, exponential: Callable[[DrArray], DrArray] | None = None) -> list[DrArray]:
        """Return the weights of both pixels for a point at distance t past the first centre.

        Their border lies at 1/2.
        """
        s = (t - 0.5) * (1 / self.blur)
        s = 0.5 * (abs(s + 1) - abs(s - 1))  # clipped to [-1, 1]
        square = s * s
        second = 0.5 + s * (0.9375 - 0.625 * square + 0.1875 * square * square)
        return [1.0 - second, second]

    def response(self) -> Floats:
        beside = self.blur * 5 / 32
        return np.array([beside, 1 - 2 * beside, beside])


@dataclass(frozen=True)
class GaussianWindow:
    """W = g(x) g(y), g a Gaussian of sigma pixels, lowered to zero at `cut` sigma (2.36-2.37)."""

    sigma: float = 1.0
    cut: float = 4.0

    @property
    def taps(self) -> int:
        return 2 * ceil(self.cut * self.sigma)

    @property
    def _offset(self) -> float:
        return exp(-0.5 * self.cut**2)

    @property
    def _norm(self) -> float:
        s, c = self.sigma, self.cut
        return s * (sqrt(2 * pi) * erf(c / sqrt(2)) - 2 * c * self._offset)

    def weights(self, t: DrArray, exponential: Callable[[DrArray], DrArray]) -> list[DrArray]:
        """Return g(t + m) - g(cut), m = taps/2 - 1 ... -taps/2, for t in [0, 1).

        g(t + m) = g(t) exp(-t / sigma^2)^m g(m) / g(0): two exponentials serve all taps.
        """
        half, s2 = self.taps // 2, self.sigma**2
        ratio = exponential(t * (-1 / s2))
        upward = [exponential(t * t * (-0.5 / s2)) * (1 / self._norm)]
        downward = upward[:]
        for _ in range(half - 1):
            upward.append(upward[-1] * ratio)
        for _ in range(half):
            downward.append(downward[-1] / ratio)
        powers = upward[:0:-1] + downward
        all_within = self.cut * self.sigma == half  # no tap lies beyond the cut
        rows = []
        for m, value in zip(range(half - 1, -half - 1, -1), powers):
            lowered = value * exp(-0.5 * m * m / s2) - self._offset / self._norm
            rows.append(lowered if all_within else (lowered + abs(lowered)) * 0.5)
        return rows

    def response(self) -> Floats:
        most = ceil(self.cut * self.sigma + 0.5)
        edges = np.clip(np.arange(-most, most + 2) - 0.5, -self.cut * self.sigma, self.cut * self.sigma)
        gauss = np.array([self.sigma * sqrt(pi / 2) * erf(e / (self.sigma * sqrt(2))) for e in edges])
        return (np.diff(gauss) - self._offset * np.diff(edges)) / self._norm


def cardinal_weights(t: DrArray, degree: int) -> list[DrArray]:
    """Return the uniform B-splines M_p(t + p - r), r = 0..p, at t in [0, 1); t may be any array type."""
    values = [1.0]
    for k in range(1, degree + 1):
        rows = []
        for r in range(k + 1):
            left = (t + (k - r)) * values[r - 1] if r > 0 else 0.0
            right = ((r + 1) - t) * values[r] if r < k else 0.0
            rows.append((left + right) * (1.0 / k))
        values = rows
    return values


def filter_image(image: Floats, window: Window) -> Floats:
    """Return what the window measures of an irradiance that is constant on every pixel, dark outside."""
    response = window.response()
    for axis in (0, 1):
        image = correlate1d(image, response, axis=axis, mode="constant")
    return image
