"""What the light of a perturbed lens is judged by, and how much of its limits it takes.

Limits are those of rel_l2 at most, and of min_over_mean (U0) and efficiency at least.  An error takes the
parts

    (rel_l2^2 - rel_l2_0^2) / (limit^2 - rel_l2_0^2)        (m_0 - m) / (m_0 - limit)

of them: 0 is the design, 1 the limit.  In squares errors of random phase add up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

from optics.base.runtime import UserError
from optics.light.analysis import LightEstimate, box_screen, per_area, uniformity_metrics
from optics.tolerancing.perturbations.traced_light import PerturbedLight
from thbcad.checks import Floats

Limits = Mapping[str, float]

RISE = 0.01  # what rel_l2 may rise by where nothing else is said
KEPT = 0.99  # of the design's efficiency, that light must keep where nothing else is said
EVEN = 0.7  # min_over_mean that uniform light must keep where nothing else is said
NOT_UNIFORM = "the light asked for is not uniform"  # why it has no min_over_mean
NAMES = ("rise", "rel_l2", "min_over_mean", "efficiency")


@dataclass(frozen=True)
class LightNumbers:
    """What light is judged by.

    rel_l2 : without the noise of counted rays.
    min_over_mean : U0 on boxes, see `optics.scene.photometry.uniformity`; None of a picture.
    """

    rel_l2: float
    efficiency: float
    min_over_mean: float | None = None

    def data(self) -> dict[str, float]:
        """Return the numbers that there are, by name."""
        return {name: value for name, value in asdict(self).items() if value is not None}


@dataclass(frozen=True, eq=False)
class LightJudge:
    """What is asked for.

    target : of the system, (rows, columns), at any scale.  light : of the perturbed lenses.
    blur : see `optics.light.blur.spot_rms`.
    """

    target: Floats
    light: PerturbedLight
    blur: float = 0.0

    @property
    def uniform(self) -> bool:
        """Whether the same light is asked for everywhere in a region."""
        return self.light.system.target.uniform_region is not None

    def numbers(self, light: LightEstimate) -> LightNumbers:
        """Return the numbers of light: flux per du dv on the target's pixels and boxes."""
        system = self.light.system
        seen = per_area(light, self.light.screen, box_screen(system))
        least = self._uniformity(seen)["min_over_mean"] if self.uniform else None
        if self.uniform and least is None and seen.irradiance[system.target.lit_pixels].sum() <= 0:
            least = 0.0
        off = seen.error_of_rel_l2(self.target)["rel_l2_debiased"]
        return LightNumbers(off, light.on_target / system.problem.flux, least)

    def why_unknown(self, light: LightEstimate) -> str:
        """Return why light has no min_over_mean, "" where it has one.  light : as of `numbers`."""
        if not self.uniform:
            return NOT_UNIFORM
        seen = per_area(light, self.light.screen, box_screen(self.light.system))
        return str(self._uniformity(seen)["reason"])

    def _uniformity(self, seen: LightEstimate) -> dict[str, Any]:
        return uniformity_metrics(self.light.system, seen, self.blur)


def usual_limits(light: PerturbedLight, design: LightNumbers) -> dict[str, float]:
    """Return what holds where no limits are given: min_over_mean EVEN of uniform light, else a rise by RISE.

    Efficiency must be KEPT of the design's: neither of them sees light that is lost.

    Boxes that rays are counted in differ by chance, and the least of them most of all.
    """
    known = design.min_over_mean is not None and light.by_cells
    limits = {"min_over_mean": EVEN} if known else {"rise": RISE}
    return limits | ({"efficiency": KEPT * design.efficiency} if design.efficiency else {})


def limits_of(asked: float | Limits | None, usual: Limits) -> dict[str, float]:
    """Return limits by name.  asked : them, or one number, that rel_l2 may rise by; None is the usual ones.

    Raises UserError : an unknown name, or a number that is no limit.
    """
    if asked is None:
        return dict(usual)
    limits = dict(asked) if isinstance(asked, Mapping) else {"rise": asked}
    for name, value in limits.items():
        if name not in NAMES:
            raise UserError(f"there is no limit {name!r}; there are {', '.join(NAMES)}")
        number = isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
        if name == "rise" and not (number and value > 0):
            raise UserError(f"limit must be a positive rise of rel_l2, such as 0.01, got {value!r}")
        if not (number and 0 < value < 1):
            raise UserError(
                f"the limit of {name} must lie between 0 and 1, such as 0.05 or 5%, got {value!r}"
            )
    if not limits:
        raise UserError("give a limit at least, such as rel_l2=0.05")
    return limits


def bounds_of(limits: Limits, design: LightNumbers, unknown: str) -> dict[str, float]:
    """Return the limits as values that light must keep, by name; of two for rel_l2 the lower one.

    unknown : why the design has no min_over_mean, where it has none.

    Raises UserError : a limit of min_over_mean there.
    """
    bounds = {name: value for name, value in limits.items() if name != "rise"}
    if "rise" in limits:
        most = design.rel_l2 + limits["rise"]
        bounds = {"rel_l2": most} | bounds  # the first of them
        bounds["rel_l2"] = min(most, bounds["rel_l2"])
    if "min_over_mean" in bounds and design.min_over_mean is None:
        raise UserError(f"min_over_mean is not known of this light: {unknown}; limit rel_l2 or efficiency")
    return bounds


def parts_taken(bounds: Limits, design: LightNumbers, now: LightNumbers) -> dict[str, float]:
    """Return the part of each limit that light takes; inf of one that the design does not keep, or that light
    does not tell."""
    before, behind = design.data(), now.data()
    parts = {}
    for name, bound in bounds.items():
        if name not in behind:
            parts[name] = float("inf")
            continue
        power = 2 if name == "rel_l2" else 1
        room, taken = (a**power - before[name] ** power for a in (bound, behind[name]))
        if name != "rel_l2":
            room, taken = -room, -taken
        parts[name] = taken / room if room > 0 else float("inf")
    return parts


def missed(bounds: Limits, design: LightNumbers) -> dict[str, Any]:
    """Return the limits that the design itself does not keep, by name."""
    parts = parts_taken(bounds, design, design)
    return {name: bounds[name] for name, part in parts.items() if not isfinite(part)}
