"""What each tolerance costs, traced exactly at plus and minus its amount.

Beside it stands what the derivatives of the landing points predict (`LinearLight.moved`).  Irradiance itself
is no good for a prediction: its derivative holds for hundredths of a pixel only, see there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from optics.analysis import rel_l2, unit_mean
from optics.runtime import UserError, speaking_of
from optics.tolerancing.allowed_amount import amount_of
from optics.tolerancing.linear_light import LinearLight
from optics.tolerancing.tolerance_names import Tolerance, tolerances_of
from optics.tolerancing.traced_light import PerturbedLight

if TYPE_CHECKING:
    from optics.runtime import Backend
    from optics.system import OpticalSystem
    from optics.tolerancing.perturbation import Floats, Perturbation
    from thbcad.lens import Lens

TENTH = 0.1  # of a pixel: what light moves by where model and trace are compared
LIMIT = 0.01  # what rel_l2 may rise by
DIGITS = 8  # of numbers told: sums by several threads differ in later ones
STILL = 1e-9  # of a pixel per amount: what moves no light


@dataclass(frozen=True, eq=False)
class ToleranceEffect:
    """What one tolerance does.

    moves : how far its amount moves the light, mm (degrees in the far field), and pixels.
    rel_l2, efficiency : traced at - amount and + amount.
    predicted : rel_l2 there by `LinearLight.moved`; None of rays and cut cells.
    tenth : the amount that moves light by a tenth of a pixel; None where it moves none.
    prediction_error, derivative_error : of the predicted dE, and of dE = J p, at that amount, relative to the
        dE of `LinearLight.traced`; None of rays and cut cells, and where no lens is so wrong.
    allowed : the amount at which rel_l2 rises by the limit, with what is traced there; None where no amount
        was found.
    change : of the light by + amount, both scaled to unit mean, (rows, columns).
    rise : of rel_l2^2 at the amount, mean of both signs.
    """

    tolerance: Tolerance
    moves: tuple[float, float]
    rel_l2: tuple[float, float]
    predicted: tuple[float, float] | None
    efficiency: tuple[float, float]
    tenth: float | None
    prediction_error: float | None
    derivative_error: float | None
    allowed: tuple[float, float] | None
    change: Floats
    rise: float


@dataclass(frozen=True, eq=False)
class ToleranceBudget:
    """The effects of all tolerances of a design.

    rel_l2, efficiency : of the design, by the cells or rays that are traced here.  limit : rise of rel_l2.
    unit : of lengths on the target.  irradiance, target : (rows, columns), scaled to unit mean.
    """

    effects: tuple[ToleranceEffect, ...]
    rel_l2: float
    efficiency: float
    limit: float
    unit: str
    irradiance: Floats
    target: Floats

    @property
    def expected(self) -> float:
        """rel_l2, root mean square, where every error is anything up to its amount, all equally likely.

        The mean of a^2 over |a| <= 1 is 1 / 3; rises of rel_l2^2 add up for independent errors.
        """
        return sqrt(max(self.rel_l2**2 + sum(e.rise for e in self.effects) / 3, 0.0))

    def shares(self) -> dict[str, float]:
        """Return the share of each tolerance in the expected rise of rel_l2^2, by name, largest first."""
        rises = {e.tolerance.name: max(e.rise, 0.0) for e in self.effects}
        total = sum(rises.values()) or 1.0
        return dict(sorted(((n, r / total) for n, r in rises.items()), key=lambda row: -row[1]))

    def data(self) -> dict[str, Any]:
        """Return it as numbers by name, for tolerance.json."""
        shares = self.shares()
        data = {
            "rel_l2": self.rel_l2,
            "efficiency": self.efficiency,
            "limit": self.limit,
            "distribution": "uniform between - amount and + amount, independent",
            "expected_rel_l2": self.expected,
            "tolerances": {e.tolerance.name: _data(e, shares, self.unit) for e in self.effects},
        }
        return {key: _rounded(value) for key, value in data.items()}


def _rounded(value: Any) -> Any:
    """Return numbers with DIGITS digits, in tables and rows too."""
    if isinstance(value, dict):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def _data(effect: ToleranceEffect, shares: Mapping[str, float], unit: str) -> dict[str, Any]:
    tolerance, allowed = effect.tolerance, effect.allowed
    return {
        "unit": tolerance.unit,
        "amount": tolerance.amount,
        f"moves_{unit}": effect.moves[0],
        "moves_pixels": effect.moves[1],
        "rel_l2": list(effect.rel_l2),
        "rel_l2_predicted": None if effect.predicted is None else list(effect.predicted),
        "efficiency": list(effect.efficiency),
        "tenth_of_a_pixel": effect.tenth,
        "prediction_error": effect.prediction_error,
        "derivative_error": effect.derivative_error,
        "allowed": None if allowed is None else allowed[0],
        "rel_l2_at_allowed": None if allowed is None else allowed[1],
        "share": shares[tolerance.name],
    }


def tolerance_budget(
    system: OpticalSystem,
    lens: Lens,
    target: Floats,
    backend: Backend,
    amounts: Mapping[str, float] | None = None,
    limit: float = LIMIT,
    progress: Callable[[str, int, int], None] | None = None,
) -> ToleranceBudget:
    """Return the ToleranceBudget of a lens.

    target : the light asked for, (rows, columns), at any scale.  backend : of double precision.
    amounts : see `tolerances_of`.  limit : rise of rel_l2 for which amounts are looked for.
    progress : called with a tolerance's name, its number from 0, and how many there are.

    Raises
    ------
    UserError : see `tolerances_of`; a limit that is not positive.
    """
    if not (isinstance(limit, int | float) and isfinite(limit) and limit > 0):
        raise UserError(f"limit must be a positive rise of rel_l2, such as 0.01, got {limit!r}")
    chosen = tolerances_of(system, amounts)
    if not chosen:
        raise UserError("every tolerance is 0, so that nothing is left to look at; give one an amount")
    trial = _Trial(PerturbedLight(system, lens, backend), target, limit)
    effects = []
    for k, tolerance in enumerate(chosen):
        if progress:
            progress(tolerance.name, k, len(chosen))
        with speaking_of(f"{tolerance.name} = {tolerance.words}"):
            effects.append(trial.effect(tolerance))
    return ToleranceBudget(
        effects=tuple(effects),
        rel_l2=trial.rel_l2,
        efficiency=trial.efficiency,
        limit=limit,
        unit="degrees" if system.target.far_field else "mm",
        irradiance=trial.scaled,
        target=trial.target,
    )


class _Trial:
    """One design on trial: its light, and what comes of perturbing it."""

    def __init__(self, light: PerturbedLight, target: Floats, limit: float) -> None:
        self._light, self._limit = light, limit
        self._flux = light.system.problem.source.flux
        self._linear = LinearLight(light)
        self.target = unit_mean(target)
        irradiance, self.efficiency = self._linear.irradiance, self._linear.fates.on_target / self._flux
        self.scaled = unit_mean(irradiance)
        self.rel_l2 = rel_l2(irradiance, target)
        self._pixel = float(np.mean(light.screen.pitch))

    def effect(self, tolerance: Tolerance) -> ToleranceEffect:
        """Return what a tolerance does."""
        amount = tolerance.amount
        moves = self._light.moved_by(tolerance.at(amount))
        moves = moves if moves > STILL * self._pixel else 0.0
        images, efficiency = zip(*(self._traced(tolerance.at(sign * amount)) for sign in (-1, 1)))
        behind, ahead = (rel_l2(image, self.target) for image in images)
        tenth = None
        errors: tuple[float | None, float | None] = None, None
        if moves:
            tenth = TENTH * self._pixel / moves * amount
            errors = self._prediction_errors(tolerance.at(tenth))
        return ToleranceEffect(
            tolerance=tolerance,
            moves=(moves, moves / self._pixel),
            rel_l2=(behind, ahead),
            predicted=self._predicted(tolerance),
            efficiency=(efficiency[0], efficiency[1]),
            tenth=tenth,
            prediction_error=errors[0],
            derivative_error=errors[1],
            allowed=self._allowed(tolerance, max(behind, ahead)),
            change=images[1] - self.scaled,
            rise=(behind**2 + ahead**2) / 2 - self.rel_l2**2,
        )

    def _traced(self, perturbation: Any) -> tuple[Floats, float]:
        """Return light scaled to unit mean, and the efficiency."""
        image, fates = self._light(perturbation)
        return unit_mean(image), fates.on_target / self._flux

    def _predicted(self, tolerance: Tolerance) -> tuple[float, float] | None:
        """Return rel_l2 at - amount and + amount by landing points that move in proportion."""
        moved = self._linear.moved(tolerance.at(tolerance.amount))
        if moved is None:
            return None
        behind, ahead = (rel_l2(image, self.target) for image in moved)
        return behind, ahead

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

    def _allowed(self, tolerance: Tolerance, worst: float) -> tuple[float, float] | None:
        """Return the amount at which the worse sign raises rel_l2 by the limit, and rel_l2 there."""
        square = self.rel_l2**2

        def rise(amount: float) -> float:
            found = (rel_l2(self._traced(tolerance.at(s * amount))[0], self.target) for s in (-1, 1))
            return max(found) ** 2 - square

        wanted = (self.rel_l2 + self._limit) ** 2 - square
        found = amount_of(rise, wanted, (tolerance.amount, worst**2 - square))
        return None if found is None else (found[0], sqrt(max(found[1] + square, 0.0)))
