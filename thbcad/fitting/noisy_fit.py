"""Fits to noisy samples: smoothed as much as the noise asks for, and the linear map that was used.

With S = A (A^T A + smoothing E)^-1 A^T the fitted values are those of four passes,

    H z,   H = 1 - (1 - S)^4,

each of which fits what those before it left.  They part waves more sharply than one does: of a wave that one
pass lowers by 30 % four take 1 %.  The smoothing is the least of generalised cross-validation,
V = n |z - H z|^2 / (n - tr H)^2.  The noise is sigma^2 = |z - H z|^2 / tr (1 - H)^T (1 - H).  Both traces
are estimated with vectors of random signs, the same for all smoothings.

Source: J. Tukey, Exploratory Data Analysis (1977), section 16 ("twicing"); P. Craven, G. Wahba, Smoothing
noisy data with spline functions, Numer. Math. 31 (1979); D. Girard, A fast Monte-Carlo cross-validation
procedure, Numer. Math. 56 (1989).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats, floats, require_number, require_type
from thbcad.fitting.least_squares_fit import Samples
from thbcad.fitting.normal_equations import Factors, NormalEquations, thin_plate
from thbcad.hierarchy import THBSpace
from thbcad.surfaces import THBSurface

LEAST_SAMPLES = 16  # as many as a bicubic has coefficients
PASSES = 4  # of waves of 2.5 mm among noise as high two lose 11 % of the light's error, four 7, eight 5
PROBES = 4  # the traces of 10^5 samples are then known to 0.2 %
SEED = 0x5EED516  # of the signs: samples drawn with a usual seed must not share their bits with them
WEAKEST = -1  # power of ten below the smoothing that halves a wave of two cells: less makes no difference
HALF_OF_DOMAIN = 500.0  # side^4 over the smoothing that halves a wave of the domain's length, (2 pi)^4 / 3


@dataclass(frozen=True, eq=False)
class NoisyFit:
    """A fit to noisy samples.

    surface : of all passes.
    noise : standard deviation of the samples' noise.  freedom : tr H, how many samples the fit follows.
    smoothing : as in `least_squares`.  residuals : z - H z, (n,).
    """

    surface: THBSurface
    noise: float
    freedom: float
    smoothing: float
    residuals: Floats
    _map: _Passes

    def carried(self, values: ArrayLike) -> Floats:
        """Return the coefficients that other values at the same places would get, (dim,) or (dim, m).

        values : (n,) or (n, m).
        """
        return self._map.coefficients(floats(values))


@dataclass(frozen=True, eq=False)
class _Passes:
    """The linear map from values to the coefficients of all passes."""

    equations: NormalEquations
    factors: Factors

    def one(self, values: Floats) -> Floats:
        return self.factors.solve(self.equations.weighted @ values)

    def coefficients(self, values: Floats) -> Floats:
        total = self.one(values)
        for _ in range(PASSES - 1):
            total = total + self.one(values - self.equations.collocation @ total)
        return total


@dataclass(frozen=True, eq=False)
class _Score:
    """What one smoothing does.

    value : V.  coefficients, (dim,), and residuals, (n,), are over the height of the equations.
    """

    value: float
    noise: float
    freedom: float
    coefficients: Floats
    residuals: Floats


def fit_noisy(space: THBSpace, samples: Samples, smoothing: float | None = None) -> NoisyFit:
    """Return the fit of scalar samples of equal weight, smoothed as their noise asks for.

    The space may be finer than the samples resolve: the smoothing bridges what lies between them.

    smoothing : a positive number instead, as in `least_squares`.

    Raises ValueError : fewer than 16 samples, values that are not scalar, weights that differ, samples
        outside the domain.
    Raises Underdetermined : the samples do not determine a plane, as those on one line.
    """
    require_type("space", space, THBSpace)
    require_type("samples", samples, Samples)
    if smoothing is not None:
        require_number("smoothing", smoothing, above=0, finite=True)
    if len(samples) < LEAST_SAMPLES:
        raise ValueError(f"a fit to noisy samples needs at least {LEAST_SAMPLES} of them, got {len(samples)}")
    if samples.values.ndim != 1 or np.ptp(samples.weights) > 0:
        raise ValueError("a fit to noisy samples needs scalar values of equal weight")
    equations = NormalEquations.of(
        space,
        space.collocation(samples.u, samples.v),
        thin_plate(space),
        samples.values,
        np.ones(len(samples)),
    )
    smoothing = _chosen(equations) if smoothing is None else smoothing
    passes = _Passes(equations, equations.factors(smoothing))
    score = _score(passes)
    return NoisyFit(
        surface=THBSurface(space, equations.height * score.coefficients),
        noise=score.noise,
        freedom=score.freedom,
        smoothing=smoothing,
        residuals=equations.height * score.residuals,
        _map=passes,
    )


def _chosen(equations: NormalEquations) -> float:
    """Return the smoothing of least V: the least power of ten, and the parabola through its neighbours.

    The search starts with the smoothing that halves a wave of two cells, and goes on while V falls.
    """
    u0, u1, v0, v1 = equations.space.boxes.T
    sides = u1.max() - u0.min(), v1.max() - v0.min()
    density = len(equations.values) / (sides[0] * sides[1])
    cell = min((u1 - u0).min(), (v1 - v0).min())
    start = np.log10(density) + 4 * np.log10(cell / np.pi)
    steps = int(np.ceil(np.log10(density * max(sides) ** 4 / HALF_OF_DOMAIN) - start))
    values: dict[int, float] = {}

    def value(k: int) -> float:
        if k not in values:
            values[k] = _score(_Passes(equations, equations.factors(float(10 ** (start + k))))).value
        return values[k]

    best = 0
    while best < steps and value(best + 1) < value(best):
        best += 1
    while best > WEAKEST and value(best - 1) < value(best):
        best -= 1
    shift = 0.0
    if WEAKEST < best < steps and value(best) > 0:
        low, here, high = np.log([value(best - 1), value(best), value(best + 1)])
        bend = low - 2 * here + high
        shift = float((low - high) / bend / 2) if bend > 0 else 0.0
    return float(10 ** (start + best + shift))


def _score(passes: _Passes) -> _Score:
    """Return V, the noise and tr H of a smoothing."""
    equations = passes.equations
    n = len(equations.values)
    probes = np.random.default_rng(SEED).choice([-1.0, 1.0], (n, PROBES))
    values = np.column_stack([equations.values, probes])
    coefficients = passes.coefficients(values)
    left = values - equations.collocation @ coefficients
    squares = float(left[:, 0] @ left[:, 0])
    free = float(np.sum(probes * left[:, 1:])) / PROBES  # n - tr H
    mean = float(np.sum(left[:, 1:] ** 2)) / PROBES
    noise = equations.height * np.sqrt(squares / mean) if mean else 0.0
    value = n * squares / free**2 if free > 0 else float("inf")
    return _Score(value, float(noise), n - free, coefficients[:, 0], left[:, 0])
