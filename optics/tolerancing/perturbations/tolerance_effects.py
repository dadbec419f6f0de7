"""What each tolerance of a design does to its light, and how large each may be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt
from typing import Any

from optics.tolerancing.perturbations.light_limits import RISE, LightNumbers, missed
from optics.tolerancing.perturbations.tolerance_names import Tolerance
from thbcad.checks import Floats

DIGITS = 8  # of numbers told: sums by several threads differ in later ones


@dataclass(frozen=True)
class Allowed:
    """The greatest amount of one error alone that keeps all limits.

    light : at its worse sign.  limit : the name of the one that is reached.
    """

    amount: float
    light: LightNumbers
    limit: str


@dataclass(frozen=True, eq=False)
class ToleranceEffect:
    """What one tolerance does.

    moves : how far its amount moves the light, mm (degrees in the far field), and pixels.
    ends : what light is judged by, traced at - amount and + amount.
    predicted : rel_l2 there by `LinearLight.moved`; None of rays and cut cells.
    tenth : the amount that moves light by a tenth of a pixel; None where it moves none.
    prediction_error, derivative_error : of the predicted dE, and of dE = J p, at that amount, relative to the
        dE of `LinearLight.traced`; None of rays and cut cells, and where no lens is so wrong.
    allowed : None where no error that was tried reaches a limit, and where the design itself misses one.
    change : of the light by + amount, both scaled to unit mean, (rows, columns).
    rise : of rel_l2^2 at the amount, mean of both signs.
    """

    tolerance: Tolerance
    moves: tuple[float, float]
    ends: tuple[LightNumbers, LightNumbers]
    predicted: tuple[float, float] | None
    tenth: float | None
    prediction_error: float | None
    derivative_error: float | None
    allowed: Allowed | None
    change: Floats
    rise: float

    @property
    def cost(self) -> float:
        """The amount in allowed ones: what is above one must be held closer; 0 where all is allowed."""
        if self.allowed is None:
            return 0.0
        return self.tolerance.amount / self.allowed.amount if self.allowed.amount else float("inf")


@dataclass(frozen=True, eq=False)
class ToleranceBudget:
    """The effects of all tolerances of a design.

    effects : in the order of their names.  light : of the design, by the cells or rays that are traced here.
    bounds : what light must keep, by name.  floats : the target follows light that shifts as a whole.
    noise : standard deviation of a lit pixel in its mean, by the rays that are counted; 0 of cells.
    unit : of lengths on the target.  irradiance, target : (rows, columns), scaled to unit mean.
    outages : the light with one of several sources out, of each in turn; its efficiency is that of all.
    """

    effects: tuple[ToleranceEffect, ...]
    light: LightNumbers
    bounds: Mapping[str, float]
    floats: bool
    noise: float
    unit: str
    irradiance: Floats
    target: Floats
    outages: tuple[LightNumbers, ...] = ()

    @property
    def rel_l2(self) -> float:
        return self.light.rel_l2

    @property
    def limit(self) -> float:
        """What rel_l2 may rise by; RISE where it has no limit, or misses that."""
        room = self.bounds.get("rel_l2", 0.0) - self.rel_l2
        return room if room > 0 else RISE

    @property
    def missed(self) -> dict[str, float]:
        """The limits that the design itself does not keep."""
        return missed(self.bounds, self.light)

    @property
    def expected(self) -> float:
        """rel_l2, root mean square, where every error is anything up to its amount, all equally likely.

        The mean of a^2 over |a| <= 1 is 1 / 3; rises of rel_l2^2 add up for independent errors.
        """
        return sqrt(max(self.rel_l2**2 + sum(e.rise for e in self.effects) / 3, 0.0))

    @property
    def together(self) -> float | None:
        """What multiplies all amounts so that `expected` keeps the limit of rel_l2, to second order.

        None without such a limit, where the design misses it, and where errors raise nothing.
        """
        room = self.bounds.get("rel_l2", 0.0) ** 2 - self.rel_l2**2
        rise = self.expected**2 - self.rel_l2**2
        return sqrt(room / rise) if room > 0 and rise > 0 else None

    def by_cost(self) -> list[ToleranceEffect]:
        """Return the effects, the costliest first; those that cost nothing by their share."""
        return sorted(self.effects, key=lambda e: (-e.cost, -e.rise))

    def shares(self) -> dict[str, float]:
        """Return the share of each tolerance in the expected rise of rel_l2^2, by name, largest first."""
        rises = {e.tolerance.name: max(e.rise, 0.0) for e in self.effects}
        total = sum(rises.values()) or 1.0
        return dict(sorted(((n, r / total) for n, r in rises.items()), key=lambda row: -row[1]))

    def data(self) -> dict[str, Any]:
        """Return it as numbers by name, for tolerance.json; the costliest tolerance first."""
        shares = self.shares()
        data: dict[str, Any] = {
            **self.light.data(),
            "limits": dict(self.bounds),
            "missed_by_the_design": [*self.missed],
            "shift_floats": self.floats,
            "noise_of_a_pixel": self.noise,
            "distribution": "uniform between - amount and + amount, independent",
            "expected_rel_l2": self.expected,
            "together": self.together,
            "tolerances": {e.tolerance.name: _data(e, shares, self.unit) for e in self.by_cost()},
        }
        if self.outages:
            data["one_source_out"] = [light.data() for light in self.outages]
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
    behind, ahead = (end.data() for end in effect.ends)
    return {
        "unit": tolerance.unit,
        "held_by": tolerance.held_by,
        "amount": tolerance.amount,
        "cost": effect.cost,
        "allowed": None if allowed is None else allowed.amount,
        "limit_reached": None if allowed is None else allowed.limit,
        "at_allowed": None if allowed is None else allowed.light.data(),
        f"moves_{unit}": effect.moves[0],
        "moves_pixels": effect.moves[1],
        **{name: [behind.get(name), ahead.get(name)] for name in {**behind, **ahead}},
        "rel_l2_predicted": None if effect.predicted is None else list(effect.predicted),
        "tenth_of_a_pixel": effect.tenth,
        "prediction_error": effect.prediction_error,
        "derivative_error": effect.derivative_error,
        "share": shares[tolerance.name],
    }
