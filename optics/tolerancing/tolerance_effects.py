"""What each tolerance costs: traced exactly, and by a quadratic model of the change of light.

E, scaled to unit mean, changes by a J + a^2 S with the amount a.  With the present residual r = E - T

    rel_l2^2 = (||r||^2 + 2 a <r, J> + a^2 (||J||^2 + 2 <r, S>)) / ||T||^2.

J and S are those of two exact traces, at plus and minus an amount: light of sharp pictures has corners in its
course that a derivative does not see, such as edges along the borders of pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from optics.analysis import rel_l2
from optics.tolerancing.linear_light import LightChange, LinearLight
from optics.tolerancing.tolerance_names import Tolerance, tolerances_of
from optics.tolerancing.traced_light import PerturbedLight

if TYPE_CHECKING:
    from optics.runtime import Backend
    from optics.system import OpticalSystem
    from optics.tolerancing.perturbation import Floats
    from thbcad.lens import Lens

TENTH = 0.1  # of a pixel: what light moves by where model and trace are compared
LIMIT = 0.01  # what rel_l2 may rise by
SEARCH = 4  # traces of both signs, at most, that look for the amount that is allowed
ENOUGH = 0.02  # of the rise: so well is the amount known then
MOST = 10.0  # times as large as the amount before, at most, is the next guess
STILL = 1e-9  # of a pixel per amount: what moves no light


@dataclass(frozen=True, eq=False)
class ToleranceEffect:
    """What one tolerance does.

    moves : how far its amount moves the light, mm (degrees in the far field), and pixels.
    rel_l2, efficiency : traced at - amount and + amount.  predicted : rel_l2 there by the model of a tenth of
        a pixel.  tenth : the amount that moves light by that; None where it moves none.
    derivative_error : of dE = J p by the derivative of the light, at a tenth of a pixel, relative to the
        traced dE; None of rays and cut cells.
    allowed : the amount at which rel_l2 rises by the limit, with what is traced there; None where no amount
        was found.
    change : of the scaled light; 1 stands for the amount.
    rise : of rel_l2^2 at the amount, mean of both signs.
    """

    tolerance: Tolerance
    moves: tuple[float, float]
    rel_l2: tuple[float, float]
    predicted: tuple[float, float] | None
    efficiency: tuple[float, float]
    tenth: float | None
    derivative_error: float | None
    allowed: tuple[float, float] | None
    change: LightChange
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
        return {
            "rel_l2": self.rel_l2,
            "efficiency": self.efficiency,
            "limit": self.limit,
            "distribution": "uniform between - amount and + amount, independent",
            "expected_rel_l2": self.expected,
            "tolerances": {e.tolerance.name: _data(e, shares, self.unit) for e in self.effects},
        }


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
    UserError : see `tolerances_of`.
    """
    chosen = tolerances_of(system, amounts)
    trial = _Trial(PerturbedLight(system, lens, backend), target, limit)
    effects = []
    for k, tolerance in enumerate(chosen):
        if progress:
            progress(tolerance.name, k, len(chosen))
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
        self.target = target / target.mean()
        irradiance, self.efficiency = self._linear.irradiance, self._linear.fates.on_target / self._flux
        self.scaled = irradiance / (irradiance.mean() or 1.0)
        self.rel_l2 = rel_l2(irradiance, target)
        self._pixel = float(np.mean(light.screen.pitch))

    def effect(self, tolerance: Tolerance) -> ToleranceEffect:
        """Return what a tolerance does."""
        amount = tolerance.amount
        moves = self._light.moved_by(tolerance.at(amount))
        images, efficiency = zip(*(self._traced(tolerance.at(sign * amount)) for sign in (-1, 1)))
        change = self._change(*images)
        behind, ahead = (rel_l2(image, self.target) for image in images)
        tenth = derivative_error = predicted = None
        if moves > STILL * self._pixel:
            tenth = TENTH * self._pixel / moves * amount
            near = self._change(*(self._traced(tolerance.at(sign * tenth))[0] for sign in (-1, 1)))
            predicted = self._predicted(near, -amount / tenth), self._predicted(near, amount / tenth)
            derivative_error = self._derivative_error(tolerance.at(tenth), near)
        return ToleranceEffect(
            tolerance=tolerance,
            moves=(moves, moves / self._pixel),
            rel_l2=(behind, ahead),
            predicted=predicted,
            efficiency=(efficiency[0], efficiency[1]),
            tenth=tenth,
            derivative_error=derivative_error,
            allowed=self._allowed(tolerance, max(behind, ahead)),
            change=change,
            rise=(behind**2 + ahead**2) / 2 - self.rel_l2**2,
        )

    def _traced(self, perturbation: Any) -> tuple[Floats, float]:
        """Return light scaled to unit mean, and the efficiency."""
        image, fates = self._light(perturbation)
        return image / (image.mean() or 1.0), fates.on_target / self._flux

    def _change(self, behind: Floats, ahead: Floats) -> LightChange:
        """Return the change through the light at minus and at plus an amount, which is 1 for it."""
        return LightChange((ahead - behind) / 2, (ahead + behind) / 2 - self.scaled)

    def _predicted(self, change: LightChange, amount: float) -> float:
        """Return rel_l2 for an amount by the quadratic model."""
        residual, j, s = self.scaled - self.target, change.first, change.second
        square = np.sum(residual**2) + 2 * amount * np.sum(residual * j)
        square += amount**2 * (np.sum(j**2) + 2 * np.sum(residual * s))
        return sqrt(max(float(square), 0.0)) / float(np.linalg.norm(self.target))

    def _derivative_error(self, perturbation: Any, near: LightChange) -> float | None:
        """Return the error of J p, relative to the traced change, where light has a derivative."""
        derivative = self._linear.derivative(perturbation)
        if derivative is None:
            return None
        mean = self._linear.irradiance.mean()
        scaled = (derivative.first - self.scaled * derivative.first.mean()) / mean
        traced = near.at(1.0)
        return float(np.linalg.norm(scaled - traced) / (np.linalg.norm(traced) or 1.0))

    def _allowed(self, tolerance: Tolerance, worst: float) -> tuple[float, float] | None:
        """Return the amount at which the worse sign raises rel_l2 by the limit, and rel_l2 there.

        Amounts are interpolated between (0, 0) and what was traced, as if rises of rel_l2^2 had a power of
        the amount.
        """
        wanted = (self.rel_l2 + self._limit) ** 2 - self.rel_l2**2
        points = [(tolerance.amount, worst**2 - self.rel_l2**2)]
        for _ in range(SEARCH):
            amount = _next(points, wanted)
            if amount is None:
                return None
            found = max(rel_l2(self._traced(tolerance.at(s * amount))[0], self.target) for s in (-1, 1))
            points.append((amount, found**2 - self.rel_l2**2))
            if abs(points[-1][1] - wanted) < ENOUGH * wanted:
                break
        best = min(points[1:], key=lambda p: abs(p[1] - wanted))
        return best[0], sqrt(max(best[1] + self.rel_l2**2, 0.0))


def _next(points: Iterable[tuple[float, float]], wanted: float) -> float | None:
    """Return the amount to try next; None where no amount raises rel_l2 so far."""
    rising = sorted(p for p in points if p[1] > 0)
    if not rising:
        return None
    below = [p for p in rising if p[1] <= wanted]
    above = [p for p in rising if p[1] > wanted]
    if below and above:
        (a, ra), (b, rb) = below[-1], above[0]
        if rb > ra:
            return float(a * (b / a) ** (np.log(wanted / ra) / np.log(rb / ra)))
    amount, rise = (below or above)[-1 if below else 0]
    return float(amount * np.clip(sqrt(wanted / rise), 1 / MOST, MOST))
