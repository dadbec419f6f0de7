"""What `fit` fits: a function by its L2 projection, or samples of which some are held out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thbcad.checks import Floats, Integers
from thbcad.fitting.least_squares_fit import Samples, least_squares, robust_weights
from thbcad.fitting.residual_statistics import AROUND, BESIDE, are_noise, neighbours
from thbcad.fitting.smoothing_choice import Smoothing
from thbcad.hierarchy import THBSpace
from thbcad.splines import Function, evaluate
from thbcad.surfaces import THBSurface

HELD_OUT = 3  # one sample in three


def held_out(count: int) -> NDArray[np.bool_]:
    """Return which of so many samples a fit does not see, (count,) bool: a random third, always the same."""
    chosen = np.zeros(count, dtype=bool)
    chosen[np.random.default_rng(0).permutation(count)[: count // HELD_OUT]] = True
    return chosen


class Check(NamedTuple):
    """What was measured of a fit.

    errors : the greatest on every leaf cell, (cells,), 0 where there is none.
    rms : at points beside the fitted ones.
    noise : whether the residuals of neighbours are independent.
    """

    errors: Floats
    rms: float
    noise: bool


@dataclass(frozen=True, eq=False)
class OfFunction:
    """Fits to a function: the L2 projection, by Gauss quadrature on the leaf cells."""

    function: Function
    smoothing: Smoothing
    samples_seen: float = np.inf  # as many as are asked for

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
        return Check(distance.max(axis=1), _rms(distance.ravel(), areas), noise=False)

    def loss(self, check: Check, refinable: NDArray[np.bool_]) -> float:
        """Return the greatest error of the cells that may be refined."""
        return float(check.errors[refinable].max(initial=0))

    def rank(self, check: Check) -> float:
        """Return the greatest error, which is least for the best fit that misses the tolerance."""
        return float(check.errors.max())


@dataclass(frozen=True, eq=False)
class OfSamples:
    """Fits to those samples that are not held out."""

    samples: Samples
    smoothing: Smoothing
    robust: bool

    @cached_property
    def hidden(self) -> NDArray[np.bool_]:
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

    @cached_property
    def apart(self) -> NDArray[np.bool_]:
        """Which samples lie beyond the values of all their neighbours.

        Others are no outliers: it is the surface that is wrong where they differ from it.
        """
        values = self.samples.values.reshape(len(self.samples), -1)
        around = values[neighbours(self.samples.u, self.samples.v, AROUND)]
        beyond = (values < around.min(axis=1)) | (values > around.max(axis=1))
        result: NDArray[np.bool_] = beyond.any(axis=1)
        return result

    def fit(self, space: THBSpace) -> THBSurface:
        return least_squares(space, self.fitted, self.smoothing, self.robust)

    def check(self, surface: THBSurface) -> Check:
        samples = self.samples
        counts = np.ones(len(samples), dtype=bool)
        if self.robust:
            counts = (robust_weights(surface, samples) > 0) | ~self.apart
        difference = (surface(samples.u, samples.v) - samples.values).reshape(len(samples), -1)
        difference[~counts] = 0
        distance = _distance(difference)
        errors = np.zeros(len(surface.space.cells))
        np.maximum.at(errors, surface.space.locate(samples.u, samples.v), distance)
        seen = difference[~self.hidden] / (distance.max() or 1.0)
        roots = np.sqrt(self.fitted.weights / self.fitted.weights.max())
        return Check(
            errors,
            _rms(distance[self.hidden & counts], samples.weights[self.hidden & counts]),
            are_noise(roots[:, None] * seen, self.beside),
        )

    def loss(self, check: Check, refinable: NDArray[np.bool_]) -> float:
        """Return the rms of the samples held out: the greatest error among much noise hardly falls."""
        return check.rms

    def rank(self, check: Check) -> float:
        """Return the rms, which is least for the best fit that misses the tolerance."""
        return check.rms


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
