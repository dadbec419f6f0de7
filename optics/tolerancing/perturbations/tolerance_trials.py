"""What each tolerance costs, traced at plus and minus its amount: within 1 % of finer traces.

Beside it stands what the derivatives of the landing points predict (`LinearLight.moved`).  Irradiance itself
is no good for a prediction: its derivative holds for hundredths of a pixel only, see there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import log, sqrt

import numpy as np

from optics.base.runtime import Backend, UserError, speaking_of
from optics.light.analysis import rel_l2, unit_mean
from optics.light.blur import spot_rms
from optics.scene.sources import SourceGroup
from optics.scene.system import System
from optics.tolerancing.perturbations.light_limits import (
    LightJudge,
    LightNumbers,
    bounds_of,
    limits_of,
    missed,
    parts_taken,
    usual_limits,
)
from optics.tolerancing.perturbations.linear_light import LinearLight
from optics.tolerancing.perturbations.perturbation import Perturbation
from optics.tolerancing.perturbations.tolerance_effects import Allowed, ToleranceBudget, ToleranceEffect
from optics.tolerancing.perturbations.tolerance_names import Tolerance, tolerances_of
from optics.tolerancing.perturbations.traced_light import PerturbedLight
from thbcad.checks import Floats

TENTH = 0.1  # of a pixel: what light moves by where model and trace are compared
STILL = 1e-9  # of a pixel per amount: what moves no light
Point = tuple[float, float]  # an amount, and the part of the limits that it takes

SEARCH = 10  # traces of both signs, at most, that look for the amount that is allowed
LEAST, AIM = 0.98, 0.99  # of the limits: so much an allowed amount takes, and the next one is to take
POWER = 2.0  # of the amount, with which parts grow as long as one amount is known: that of rel_l2^2
POWERS = 0.5, 8.0  # within which they grow between two amounts
FARTHER = 10.0  # times as large as the amount before, at most, is the next guess
FREE = 100.0  # times the usual amount: an error that may be so large needs no care


def tolerance_budget(
    system: System,
    target: Floats,
    backend: Backend,
    amounts: Mapping[str, float] | None = None,
    limits: float | Mapping[str, float] | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    floats: bool = False,
) -> ToleranceBudget:
    """Return the ToleranceBudget of a lens.

    target : the light asked for, (rows, columns), at any scale.  backend : of double precision.
    amounts : see `tolerances_of`.
    limits : see `limits_of` and `usual_limits`, for which amounts are looked for.
    progress : called with a tolerance's name, its number from 0, and how many there are.
    floats : light may shift as a whole: the target follows it, see `PerturbedLight.aimed`.

    Raises UserError : see `tolerances_of` and `limits_of`; min_over_mean of a picture.
    """
    asked = limits if limits is None else limits_of(limits, {})
    chosen = tolerances_of(system, amounts)
    if not chosen:
        raise UserError("every tolerance is 0, so that nothing is left to look at; give one an amount")
    trial = _Trial(PerturbedLight(system, backend, floats=floats), target, asked)
    effects = []
    for k, tolerance in enumerate(chosen):
        if progress:
            progress(tolerance.name, k, len(chosen))
        with speaking_of(f"{tolerance.name} = {tolerance.words}"):
            effects.append(trial.effect(tolerance))
    return ToleranceBudget(
        effects=tuple(effects),
        outages=trial.outages(),
        light=trial.here,
        bounds=trial.bounds,
        floats=floats,
        noise=trial.noise,
        unit=system.target.unit,
        irradiance=trial.scaled,
        target=trial.judge.target,
    )


class _Trial:
    """One design on trial: its light, and what comes of perturbing it."""

    def __init__(self, light: PerturbedLight, target: Floats, limits: Mapping[str, float] | None) -> None:
        self._light, self._linear = light, LinearLight(light)
        blur = 0.0 if light.by_cells else spot_rms(light.system, light.backend)
        self.judge = LightJudge(unit_mean(target), light, blur)
        self.scaled, here = unit_mean(self._linear.irradiance), self._linear.estimate
        self.here = self.judge.numbers(here)
        asked, unknown = limits_of(limits, usual_limits(light, self.here)), self.judge.why_unknown(here)
        self.bounds = bounds_of(asked, self.here, unknown)
        self._hopeless = bool(missed(self.bounds, self.here))
        self._pixel = float(np.mean(light.screen.pitch))

    @property
    def noise(self) -> float:
        """Standard deviation of a lit pixel in its mean, by the rays that are counted; 0 of cells."""
        lit = self.judge.target > 0
        if self._light.by_cells or not lit.any():
            return 0.0
        seen = self._linear.estimate
        return float(np.sqrt(np.mean(seen.error[lit] ** 2)) / (seen.irradiance[lit].mean() or 1.0))

    def effect(self, tolerance: Tolerance) -> ToleranceEffect:
        """Return what a tolerance does."""
        amount = tolerance.amount
        moves = self._light.moved_by(tolerance.at(amount))
        moves = moves if moves > STILL * self._pixel else 0.0
        (_, behind), (image, ahead) = (self._traced(tolerance.at(sign * amount)) for sign in (-1, 1))
        # rel_l2 at - amount and + amount by landing points that move in proportion
        images = self._linear.moved(self._light.aimed(tolerance.at(amount)))
        predicted = None
        if images is not None:
            predicted = rel_l2(images[0], self.judge.target), rel_l2(images[1], self.judge.target)
        tenth = None
        errors: tuple[float | None, float | None] = None, None
        if moves:
            tenth = TENTH * self._pixel / moves * amount
            errors = self._prediction_errors(tolerance.at(tenth))
        return ToleranceEffect(
            tolerance=tolerance,
            moves=(moves, moves / self._pixel),
            ends=(behind, ahead),
            predicted=predicted,
            tenth=tenth,
            prediction_error=errors[0],
            derivative_error=errors[1],
            allowed=self._allowed(tolerance, (behind, ahead)),  # what moves no light may lose some, if larger
            change=image - self.scaled,
            rise=(behind.rel_l2**2 + ahead.rel_l2**2) / 2 - self.here.rel_l2**2,
        )

    def outages(self) -> tuple[LightNumbers, ...]:
        """Return what light is judged by with one of several sources out, of each that shines in turn."""
        light, source = self._light, self._light.system.source
        if not isinstance(source, SourceGroup):
            return ()
        lit = [member for member in source.members if member.flux]
        found = []
        for out in lit if len(lit) > 1 else []:
            others = tuple(member for member in lit if member is not out)
            rest = replace(source, members=others, flux=source.flux - out.flux)
            system = light.system.with_prescription(own=replace(light.system.own, source=rest))
            rest_of_light, _ = PerturbedLight(system, light.backend).estimate()
            found.append(self.judge.numbers(rest_of_light))
        return tuple(found)

    def _traced(self, perturbation: Perturbation) -> tuple[Floats, LightNumbers]:
        """Return light scaled to unit mean, and what it is judged by."""
        light, _ = self._light.estimate(perturbation)
        return unit_mean(light.irradiance / self._light.screen.projection()), self.judge.numbers(light)

    def _prediction_errors(self, perturbation: Perturbation) -> tuple[float | None, float | None]:
        """Return the errors of the predicted change and of J p, relative to the traced change."""
        before = self._linear.irradiance
        try:
            moved, slope = self._linear.moved(perturbation), self._linear.derivative(perturbation)
            exact = self._linear.traced(perturbation)
        except UserError:  # it hardly moves light, so that no lens is so wrong
            return None, None
        if moved is None or slope is None or exact is None:
            return None, None
        traced = exact - before
        scale = float(np.linalg.norm(traced)) or 1.0
        by_moves, by_slope = (float(np.linalg.norm(c - traced)) / scale for c in (moved[1] - before, slope))
        return by_moves, by_slope

    def _allowed(self, tolerance: Tolerance, ends: tuple[LightNumbers, LightNumbers]) -> Allowed | None:
        """Return the greatest amount that keeps all limits; None where no error reaches one."""
        if self._hopeless:
            return None
        worst = {0.0: ("", self.here)}

        def taken(amount: float, lights: tuple[LightNumbers, ...] = ()) -> float:
            lights = lights or tuple(self._traced(tolerance.at(s * amount))[1] for s in (-1, 1))
            parts = [parts_taken(self.bounds, self.here, light) for light in lights]
            part, name, k = max((p, name, k) for k, of in enumerate(parts) for name, p in of.items())
            worst[amount] = name, lights[k]
            return part

        found = amount_of(taken, (tolerance.amount, taken(tolerance.amount, ends)))
        if found is None:
            return None
        name, light = worst[found[0]]
        return Allowed(found[0], light, name or worst[tolerance.amount][0])


def amount_of(taken: Callable[[float], float], first: Point) -> Point | None:
    """Return the greatest amount, of those tried, that takes at most all of the limits.

    None where FREE times the first amount, or the largest error that a lens can have, does so, too.

    taken : traces an amount; a UserError says that no lens is so wrong.
    """
    points, most = [first], FREE * first[0]
    for _ in range(SEARCH):
        amount = None if any(LEAST <= part <= 1 for _, part in points) else _next(points, most)
        if amount is None:
            break
        try:
            points.append((amount, taken(amount)))
        except UserError:
            most = max(amount for amount, _ in points)
            break
    broken = min((amount for amount, part in points if part > 1), default=np.inf)
    kept = max((p for p in points if p[1] <= 1 and p[0] < broken), default=(0.0, 0.0))
    return None if kept[0] >= most and kept[1] < LEAST else kept


def _next(points: Sequence[Point], most: float) -> float | None:
    """Return the amount to try next; None where the largest one keeps the limits.

    Parts are taken to grow with a power of the amount.  most : that is tried.
    """
    high = min((amount for amount, part in points if part > 1), default=None)
    below = high or np.inf
    low = max((amount for amount, part in points if part <= 1 and amount < below), default=0.0)
    guess = _by_power(points)
    if high is not None:
        low = max(low, high / FARTHER**2)
        return guess if guess is not None and low < guess < high else sqrt(low * high)
    if low >= most:
        return None
    guess = FARTHER * low if guess is None or guess <= low else guess
    return min(guess, FARTHER * low, most)


def _by_power(points: Sequence[Point]) -> float | None:
    """Return the amount that takes AIM by the two points nearest to it; None where none takes any."""
    rising = sorted((p for p in points if 0 < p[1] < np.inf), key=lambda p: abs(log(p[1] / AIM)))
    if not rising:
        return None
    (amount, part), *more = rising
    power = POWER
    if more:
        power = float(np.clip(log(more[0][1] / part) / log(more[0][0] / amount), *POWERS))
    return amount * (AIM / part) ** (1 / power)
