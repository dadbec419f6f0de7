"""The lighting classes of EN 13201-2:2015 and what a road under lamps makes of them.

P (pedestrians, low speed): the mean and the least horizontal illuminance; the mean is at most 1.5 times
that of the class, so that the light is even.  M (motor traffic): mean luminance, overall uniformity (least
over mean), longitudinal uniformity (least over greatest along the middle of a lane), each the least of
all drivers, one in the middle of every lane; the greatest threshold increment; the edge illuminance
ratio.  Values are judged as computed, not as rounded for print.

The texts of EN 13201-2 and -3 were not at hand.  What is here was compared with two public programs for the
edition of 2015 that share no code.  Both have these classes, columns, drivers, beta, formulas and drivers of
glare, and initial light for glare.  They differ from each other in the rows for illuminance (across the whole
road, as here, or in each lane), the roof (a plane across the road, as here, or a cone), and the strips of the
edge ratio (half the road, or a lane, as here).  One alone has the limits of the edge ratio, the lamps that
count, a bilinear r, and the 1.5, as advice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from optics.base.runtime import Check, UserError
from optics.base.statistics import jackknife_error
from optics.light.roads.installation import Installation
from optics.light.roads.lit_road import LitRoad
from optics.light.roads.reflection import RoadSurface
from optics.scene.luminaires import Luminaire
from thbcad.checks import Floats

MEAN, LEAST = "mean illuminance", "least illuminance"
EVEN = 1.5  # times the mean of a class P, at most


@dataclass(frozen=True)
class PedestrianClass:
    """mean, least : illuminance, lx."""

    mean: float
    least: float

    def required(self, surface: RoadSurface | None) -> None:
        """Raise UserError for a road surface: it says nothing of illuminance."""
        if surface is not None:
            raise UserError("classes P are judged by illuminance, whatever the road; leave out --r-table")

    def values(self, lit: LitRoad, surface: RoadSurface | None) -> Floats:
        """Return the values that `limits` judges.  Raises UserError : as `required`."""
        self.required(surface)
        light = lit.illuminance(lit.road.strip(0.0, lit.road.width))
        return np.array([light.mean(), light.mean(), light.min()])

    @property
    def limits(self) -> list[tuple[str, float, str, bool]]:
        """(name, limit, unit, whether it is the least) of every value."""
        return [
            (MEAN, self.mean, "lx", True),
            (f"{MEAN}, for uniformity", EVEN * self.mean, "lx", False),
            (LEAST, self.least, "lx", True),
        ]


@dataclass(frozen=True)
class MotorClass:
    """luminance : cd/m^2.  overall, along : uniformities.  glare : per cent.  edge : ratio."""

    luminance: float
    overall: float
    along: float
    glare: float
    edge: float

    def required(self, surface: RoadSurface | None) -> RoadSurface:
        """Return the road surface; UserError where there is none."""
        if surface is None:
            raise UserError(
                "classes M are judged by the luminance of a road surface; give its r-table by --r-table FILE "
                "(29 lines of 20 numbers, as CIE 144 prints R3 or C2; none with a free licence was found)"
            )
        return surface

    def values(self, lit: LitRoad, surface: RoadSurface | None) -> Floats:
        """Return the values that `limits` judges.

        Raises UserError : as `required`, or a lane in whose middle there is no light.
        """
        road, surface, found = lit.road, self.required(surface), []
        for lane, y in enumerate(road.lane_middles):
            light = lit.luminance(road.lane_points, y, surface).reshape(3 * road.lanes, -1)
            middle, mean = light[3 * lane + 1], float(light.mean())
            if not middle.max():
                raise UserError(
                    "no light reaches the middle of a lane; check --height, --overhang and --tilt"
                )
            glare = lit.threshold_increment(y, mean)
            found.append((mean, light.min() / mean, middle.min() / middle.max(), -glare))
        mean, overall, along, glare = np.min(found, axis=0)
        return np.array([mean, overall, along, -glare, lit.edge_ratio()])

    @property
    def limits(self) -> list[tuple[str, float, str, bool]]:
        """(name, limit, unit, whether it is the least) of every value."""
        return [
            ("mean luminance", self.luminance, "cd/m^2", True),
            ("overall uniformity Uo", self.overall, "", True),
            ("longitudinal uniformity Ul", self.along, "", True),
            ("threshold increment fTI", self.glare, "%", False),
            ("edge illuminance ratio REI", self.edge, "", True),
        ]


CLASSES: dict[str, PedestrianClass | MotorClass] = {
    "M1": MotorClass(2.0, 0.4, 0.7, 10, 0.35),
    "M2": MotorClass(1.5, 0.4, 0.7, 10, 0.35),
    "M3": MotorClass(1.0, 0.4, 0.6, 15, 0.3),
    "M4": MotorClass(0.75, 0.4, 0.6, 15, 0.3),
    "M5": MotorClass(0.5, 0.35, 0.4, 15, 0.3),
    "M6": MotorClass(0.3, 0.35, 0.4, 20, 0.3),
    "P1": PedestrianClass(15.0, 3.0),
    "P2": PedestrianClass(10.0, 2.0),
    "P3": PedestrianClass(7.5, 1.5),
    "P4": PedestrianClass(5.0, 1.0),
    "P5": PedestrianClass(3.0, 0.6),
    "P6": PedestrianClass(2.0, 0.4),
}


def road_checks(
    name: str,
    road: Installation,
    lamp: Luminaire,
    parts: Sequence[Luminaire] = (),
    surface: RoadSurface | None = None,
) -> list[Check]:
    """Return what a class asks for, beside what the lamps make.

    lamp : in candela.  parts : independent estimates of it, whose spread gives the errors; none: no errors.
    surface : of classes M.

    Raises UserError : a road surface that lacks, or that the class does not ask for.
    """
    asked = CLASSES[name]
    values = asked.values(LitRoad(road, lamp), surface)
    errors = np.zeros(len(values))
    if parts:
        total, rest = sum(part.candela for part in parts), len(parts) - 1
        others = [replace(lamp, candela=(total - part.candela) / rest) for part in parts]
        errors = jackknife_error(len(parts), lambda r: asked.values(LitRoad(road, others[r]), surface))
    return [
        Check(what, float(value), limit, unit, at_least=least, error=float(error), subject="light")
        for (what, limit, unit, least), value, error in zip(asked.limits, values, errors)
    ]


def uniformity(checks: Sequence[Check]) -> float | None:
    """Return U0 (least over mean illuminance) of `road_checks`; None of classes M and without light."""
    found = {check.name: check.value for check in checks}
    least, mean = found.get(LEAST), found.get(MEAN)
    return least / mean if mean and least is not None else None
