"""What `fit` fits: a function by its L2 projection, or samples of which some are held out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar, NamedTuple

import numpy as np

from thbcad.certified import distance_bounds, tensor_form
from thbcad.checks import Bools, Floats, Integers
from thbcad.fitting.least_squares_fit import Samples, least_squares, robust_weights
from thbcad.fitting.residual_statistics import BESIDE, are_noise, neighbours
from thbcad.fitting.smoothing_choice import Smoothing
from thbcad.hierarchy import THBSpace
from thbcad.sags import BoundedFunction, error_bounds
from thbcad.splines import BSplineSurface, Function, evaluate
from thbcad.surfaces import THBSurface

HELD_OUT = 3  # one sample in three


def held_out(count: int) -> Bools:
    """Return which of so many samples a fit does not see, (count,) bool: a random third, always the same."""
    chosen = np.zeros(count, dtype=bool)
    chosen[np.random.default_rng(0).permutation(count)[: count // HELD_OUT]] = True
    return chosen


class Check(NamedTuple):
    """What was measured of a fit.

    errors : the greatest on every leaf cell, (cells,), 0 where there is none.
    rms : at points beside the fitted ones.
    noise : whether the residuals of neighbours are independent.
    outliers : numbers of the samples that do not count.
    """

    errors: Floats
    rms: float
    noise: bool
    outliers: Integers


@dataclass(frozen=True, eq=False)
class OfFunction:
    """Fits to a function: the L2 projection, by Gauss quadrature on the leaf cells."""

    function: Function
    smoothing: Smoothing
    bounds: Callable[[THBSurface], Floats] | None  # of the errors on every leaf cell, where they are known
    samples_seen: ClassVar[float] = np.inf  # as many as are asked for

    @classmethod
    def of(cls, function: Function, smoothing: Smoothing, tolerance: float) -> OfFunction:
        """Return the target with the bounds that its kind has."""
        bounds: Callable[[THBSurface], Floats] | None = None
        if isinstance(function, BSplineSurface | THBSurface):
            bounds = partial(_spline_bounds, function, tolerance)
        elif isinstance(function, BoundedFunction):
            bounds = partial(_function_bounds, function)
        return cls(function, smoothing, bounds)

    @property
    def certified(self) -> bool:
        """Whether the errors are bounds."""
        return self.bounds is not None

    def fit(self, space: THBSpace) -> THBSurface:
        u, v, weights, _ = space.quadrature()
        samples = Samples(u, v, evaluate(self.function, u, v), weights)
        return least_squares(space, samples, self.smoothing)

    def check(self, surface: THBSurface) -> Check:
        space = surface.space
        fractions = ((np.arange(kv.degree + 2) + 0.5) / (kv.degree + 2) for kv in (space.kv_u, space.kv_v))
        u, v = space.cell_points(*fractions)
        difference = surface(u.ravel(), v.ravel()) - evaluate(self.function, u.ravel(), v.ravel())
        distance = _distance(difference).reshape(u.shape)
        u0, u1, v0, v1 = space.boxes.T
        areas = np.repeat((u1 - u0) * (v1 - v0), u.shape[1])
        errors = self.bounds(surface) if self.bounds else distance.max(axis=1)
        return Check(errors, _rms(distance.ravel(), areas), False, np.zeros(0, dtype=np.int64))

    def loss(self, check: Check, refinable: Bools) -> float:
        """Return the greatest error of the cells that may be refined."""
        return float(check.errors[refinable].max(initial=0))

    def rank(self, check: Check) -> float:
        """Return the greatest error, which is least for the best fit that misses the tolerance."""
        return float(check.errors.max())


def _spline_bounds(target: BSplineSurface | THBSurface, tolerance: float, surface: THBSurface) -> Floats:
    (u, v), bounds = distance_bounds(surface, target, tolerance)
    return _by_cell(surface.space, u, v, bounds)


def _function_bounds(target: BoundedFunction, surface: THBSurface) -> Floats:
    spline, slack = tensor_form(surface)
    u, v = ((kv.breaks[:-1] + kv.breaks[1:]) / 2 for kv in (spline.kv_u, spline.kv_v))
    bounds = error_bounds(target, spline).total + slack
    return _by_cell(surface.space, np.repeat(u, len(v)), np.tile(v, len(u)), bounds.ravel())


@dataclass(frozen=True, eq=False)
class OfSamples:
    """Fits to those samples that are not held out."""

    samples: Samples
    smoothing: Smoothing
    robust: bool
    certified: ClassVar[bool] = False

    @cached_property
    def hidden(self) -> Bools:
        return held_out(len(self.samples))

    @cached_property
    def fitted(self) -> Samples:
        return self.samples[~self.hidden]

    @property
    def samples_seen(self) -> float:
        """How many samples are fitted."""
        return len(self.fitted)

    @cached_property
    def beside(self) -> Integers:
        """The nearest among the fitted samples."""
        return neighbours(self.fitted.u, self.fitted.v, BESIDE)

    def fit(self, space: THBSpace) -> THBSurface:
        return least_squares(space, self.fitted, self.smoothing, self.robust)

    def check(self, surface: THBSurface) -> Check:
        samples = self.samples
        counts = np.ones(len(samples), dtype=bool)
        if self.robust:
            counts = robust_weights(surface, samples) > 0
        difference = (surface(samples.u, samples.v) - samples.values).reshape(len(samples), -1)
        difference[~counts] = 0
        distance = _distance(difference)
        seen = difference[~self.hidden] / (distance.max() or 1.0)
        roots = np.sqrt(self.fitted.weights / self.fitted.weights.max())
        return Check(
            _by_cell(surface.space, samples.u, samples.v, distance),
            _rms(distance[self.hidden & counts], samples.weights[self.hidden & counts]),
            are_noise(roots[:, None] * seen, self.beside),
            np.flatnonzero(~counts),
        )

    def loss(self, check: Check, refinable: Bools) -> float:
        """Return the rms of the samples held out: the greatest error among much noise hardly falls."""
        return check.rms

    def rank(self, check: Check) -> float:
        """Return the rms, which is least for the best fit that misses the tolerance."""
        return check.rms


def _by_cell(space: THBSpace, u: Floats, v: Floats, sizes: Floats) -> Floats:
    """Return the greatest of the sizes at points of every leaf cell, (cells,), 0 where there is none."""
    errors = np.zeros(len(space.cells))
    np.maximum.at(errors, space.locate(u, v), sizes)
    return errors


def _rms(distance: Floats, weights: Floats) -> float:
    """Return the weighted root mean square, inf of nothing."""
    if not len(distance):
        return float("inf")
    greatest = float(distance.max()) or 1.0
    squares = np.average((distance / greatest) ** 2, weights=weights / weights.max())
    return greatest * float(np.sqrt(squares))


def _distance(difference: Floats) -> Floats:
    result: Floats = np.hypot.reduce(np.abs(difference.reshape(len(difference), -1)), axis=1)
    return result
