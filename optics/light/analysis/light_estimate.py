"""Light on a target as it was measured, and the error of any number that is computed from it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from math import hypot, sqrt

import numpy as np

from optics.base.statistics import (
    drift_error,
    drift_signs,
    jackknife_error,
    root_error,
    standard_error,
    unbiased_square,
)
from optics.scene.receivers import Screen
from thbcad.checks import Bools, Floats

REPLICATES = 8  # independent measurements of light that chance touches


def no_boxes() -> Floats:
    """Return the light on no boxes."""
    return np.zeros((0, 0))


@dataclass(frozen=True, eq=False)
class Light:
    """Light in numbers that add up, each with the same leading axes.

    pixels : (..., rows, columns), W/mm^2.  on, off : (...), W in the target plane, on the screen and outside.
    boxes : (..., grid, grid), W/mm^2, of the target's uniformity; (0, 0) where it has none.
    """

    pixels: Floats
    on: Floats
    off: Floats
    boxes: Floats = field(default_factory=no_boxes)

    @classmethod
    def of(cls, images: Sequence[Floats], on: float, off: float) -> Light:
        """Return the light of images on the pixels and, if there are any, on the boxes."""
        return cls(images[0], np.asarray(on), np.asarray(off), *images[1:])

    def each(self, change: Callable[[Floats], Floats]) -> Light:
        """Return the light with all of its arrays changed alike."""
        return Light(**{f.name: change(getattr(self, f.name)) for f in fields(self)})

    def __add__(self, other: Light) -> Light:
        return Light(**{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(self)})

    def __mul__(self, factor: float) -> Light:
        return self.each(lambda a: factor * a)

    def over(self, pixels: Floats, boxes: Floats | float) -> Light:
        """Return it with the light on pixels and boxes divided, and the fluxes as they are."""
        return replace(self, pixels=self.pixels / pixels, boxes=self.boxes / boxes)


@dataclass(frozen=True, eq=False)
class LightEstimate:
    """Independent, unbiased measurements of the same light.

    draws : with a leading axis of R replicates; 1 of light that is the same every time.
    drift : the change that finer cells would make in all of them, about.
    """

    draws: Light
    drift: Light

    @classmethod
    def of_replicates(cls, draws: Iterable[Light]) -> LightEstimate:
        """Return the estimate by replicates without a drift."""
        sets = list(draws)
        stacked = Light(**{f.name: np.stack([getattr(s, f.name) for s in sets]) for f in fields(Light)})
        return cls(stacked, sets[0].each(np.zeros_like))

    @classmethod
    def exact(cls, light: Light, drift: Light | None = None) -> LightEstimate:
        """Return light that is the same every time."""
        return cls(light.each(lambda a: a[None]), drift or light.each(np.zeros_like))

    @property
    def count(self) -> int:
        """The number R of replicates."""
        return len(self.draws.on)

    @cached_property
    def mean(self) -> Light:
        """The mean of all replicates."""
        return self.draws.each(lambda a: np.asarray(a.mean(axis=0)))

    @property
    def irradiance(self) -> Floats:
        """Of the mean, (rows, columns)."""
        return self.mean.pixels

    @property
    def on_target(self) -> float:
        return float(self.mean.on)

    @property
    def off_target(self) -> float:
        return float(self.mean.off)

    @property
    def error(self) -> Floats:
        """Of the irradiance, (rows, columns), as a standard deviation."""
        return np.hypot(standard_error(self.draws.pixels), self.drift.pixels)

    def __add__(self, other: LightEstimate) -> LightEstimate:
        """Return the sum of estimates: replicate by replicate, of independent draws as of the same."""
        return LightEstimate(self.draws + other.draws, self.drift + other.drift)

    def __mul__(self, factor: float) -> LightEstimate:
        return LightEstimate(self.draws * factor, self.drift * factor)

    def over(self, pixels: Floats, boxes: Floats | float = 1.0) -> LightEstimate:
        """Return it with the light on pixels and boxes divided by functions of them."""
        return LightEstimate(self.draws.over(pixels, boxes), self.drift.over(pixels, boxes))

    def finer(self, screen: Screen) -> LightEstimate:
        """Return it on a screen of the same size with a multiple of the pixels in each direction."""
        times = screen.shape[0] // self.irradiance.shape[0]

        def repeated(light: Light) -> Light:
            pixels = light.pixels.repeat(times, axis=-2).repeat(times, axis=-1)
            return replace(light, pixels=pixels)

        return LightEstimate(repeated(self.draws), repeated(self.drift))

    def grouped(self, count: int) -> LightEstimate:
        """Return it with a part of the replicates, each the mean of as many as fall to it."""
        size = self.count // count
        draws = self.draws.each(lambda a: a.reshape(count, size, *a.shape[1:]).mean(axis=1))
        return replace(self, draws=draws)

    @property
    def drifted(self) -> Iterable[Floats]:
        """The irradiance with the drift in each of the ways of `drift_signs`."""
        return (self.irradiance + signs * self.drift.pixels for signs in drift_signs(self.irradiance.shape))

    def error_of(self, value: Callable[[Floats], float]) -> float:
        """Return the standard deviation of a function of the irradiance, (rows, columns).

        It is the jackknife's, together with the change that the drift makes.
        """
        total, images = self.draws.pixels.sum(axis=0), self.draws.pixels
        rest = max(self.count - 1, 1)
        noise = float(jackknife_error(self.count, lambda r: value((total - images[r]) / rest)))
        if not self.drift.pixels.any():
            return noise
        return hypot(noise, drift_error(value(self.irradiance), [value(image) for image in self.drifted]))

    def error_of_sum(self, weights: Floats | Bools) -> float:
        """Return the standard deviation of a weighted sum of the irradiance.  weights : (rows, columns)."""
        chosen = np.asarray(weights, np.float64)
        sums = np.tensordot(self.draws.pixels, chosen, 2)
        drifts = [float(np.sum(signs * self.drift.pixels * chosen)) for signs in drift_signs(chosen.shape)]
        return hypot(float(standard_error(sums)), drift_error(0.0, drifts))

    @property
    def error_of_on_target(self) -> float:
        return hypot(float(standard_error(self.draws.on)), float(self.drift.on))

    @property
    def error_of_off_target(self) -> float:
        return hypot(float(standard_error(self.draws.off)), float(self.drift.off))

    def error_of_rel_l2(self, target: Floats) -> dict[str, float]:
        """Return rel_l2 = ||E - T|| / ||T|| of unit means without its bias by noise, and its error.

        rel_l2_floor : the L2 norm of E's error, relative to T.
        rel_l2_debiased : the root of the mean of (E_r - T, E_s - T) / ||T||^2 over replicates r != s, see
            `unbiased_square`.
        rel_l2_error : its standard deviation, with the change that the drift makes.
        """
        norm = float(np.linalg.norm(target) / target.mean())
        if self.irradiance.mean() <= 0:
            return {"rel_l2_floor": 0.0, "rel_l2_debiased": 1.0, "rel_l2_error": 0.0}
        goal = target / target.mean()
        draws = self.draws.pixels.reshape(self.count, -1)
        means = draws.mean(axis=1, keepdims=True)
        residuals = draws / (means if (means > 0).all() else draws.mean()) - goal.ravel()
        square, variance = unbiased_square(residuals / norm)
        debiased = sqrt(max(square, 0.0))
        error = root_error(square, variance)
        if self.drift.pixels.any():
            plain = float(np.linalg.norm(self.irradiance / self.irradiance.mean() - goal)) / norm
            changed = [float(np.linalg.norm(e / e.mean() - goal)) / norm for e in self.drifted]
            error = hypot(error, drift_error(plain, changed))
        floor = float(np.linalg.norm(self.error)) / float(self.irradiance.mean()) / norm
        return {"rel_l2_floor": floor, "rel_l2_debiased": debiased, "rel_l2_error": error}
