"""The problem's limits of manufacture: by how much a lens may miss them, and advice before a design."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import floor, isfinite, log2
from typing import TYPE_CHECKING

from optics.problem.manufacture_text import position, positions
from optics.runtime import Check, UserError
from thbcad.lens import NM_PER_MM, Lens, manufacturability, mass

if TYPE_CHECKING:
    from optics.problem.schema import Limits, Problem
    from thbcad.certified import Enclosure
    from thbcad.lens import HeightRange, Manufacturability, SurfaceMetrics

THICKNESSES = {
    "thickness": "thickness",
    "centre_thickness": "centre thickness",
    "edge_thickness": "edge thickness",
}


@dataclass(frozen=True)
class Miss:
    """How far a quantity lies on the wrong side of limits.`key`: at most `most`, at least `least`.

    Both are 0 within the limit.

    side : "short of" or "beyond".
    """

    quantity: str
    side: str
    key: str
    most: float
    least: float
    unit: str
    where: str = ""


def require_limits(problem: Problem) -> None:
    """Raise UserError where a limit needs a key that is missing."""
    if isfinite(problem.limits.mass) and not problem.lens.density:
        raise UserError(
            f"limits.mass of {problem.limits.mass:g} g needs lens.density, the density in g/cm^3, "
            "which is 0 (unknown)"
        )


def limit_checks(problem: Problem, metrics: Manufacturability) -> list[Check]:
    """Return by how much the lens may miss each of the problem's limits, with the position.

    The numbers come from certified bounds, that of the mass from quadrature.
    """
    return [
        Check(f"{m.quantity} {m.side} limits.{m.key}{m.where}", m.most, 0, m.unit)
        for m in _misses(problem, metrics)
    ]


def limit_advice(problem: Problem, lens: Lens) -> list[str]:
    """Return a sentence for every limit that the lens misses without its sags.

    Levels too fine for limits.feature get one too.
    """
    if problem.limits == type(problem.limits)():
        return []
    bare = Lens(replace(lens.front, sag=None), replace(lens.rear, sag=None), lens.thickness, lens.index)
    missed = [m for m in _misses(problem, manufacturability(bare)) if m.least > 0]
    sentences = [
        f"before optimisation the {m.quantity} is {m.least:.4g} {m.unit} {m.side} limits.{m.key}{m.where}"
        for m in missed
    ]
    return sentences + list(_feature_advice(problem))


def _misses(problem: Problem, metrics: Manufacturability) -> Iterator[Miss]:
    limits, free = problem.limits, {"front": problem.lens.front.freeform is not None, "rear": True}
    for key, quantity in THICKNESSES.items():
        if getattr(limits, key):
            yield _short(quantity, key, getattr(limits, key), getattr(metrics, key))
    for name, surface in metrics.surfaces.items():
        if free[name]:
            yield from _free_misses(name, surface, limits, problem.source.wavelength)
        yield from _height_misses(name, surface, limits)
    if isfinite(limits.mass):
        amount = max(0.0, mass(metrics.volume, problem.lens.density) - limits.mass)
        yield Miss("mass", side="beyond", key="mass", most=amount, least=amount, unit="g")


def _free_misses(name: str, surface: SurfaceMetrics, limits: Limits, wavelength: float) -> Iterator[Miss]:
    """Yield the limits that hold for free surfaces."""
    if limits.radius:
        least = min((surface.concave, surface.convex), key=lambda radius: radius.lower)
        yield _short(f"radius of the {name}", "radius", limits.radius, least)
    if limits.concave_radius:
        yield _short(
            f"concave radius of the {name}", "concave_radius", limits.concave_radius, surface.concave
        )
    if limits.feature and surface.feature is not None:
        amount = max(0.0, limits.feature - surface.feature.wavelengths(wavelength))
        yield Miss(
            quantity=f"smallest feature of the {name}",
            side="short of",
            key="feature",
            most=amount,
            least=amount,
            unit="wavelengths",
            where=f", on level {surface.feature.level}",
        )


def _height_misses(name: str, surface: SurfaceMetrics, limits: Limits) -> Iterator[Miss]:
    """Yield the limits that hold for every surface."""
    if limits.slope < 90:
        yield _beyond(
            f"slope of the {name}", "slope", limits.slope, surface.slope, "degrees", position(surface.slope)
        )
    if isfinite(limits.sag_range):
        where = positions(surface.heights)
        yield _beyond(
            f"range of heights of the {name}", "sag_range", limits.sag_range, surface.heights, "mm", where
        )


def _short(quantity: str, key: str, limit: float, bound: Enclosure) -> Miss:
    most, least = (max(0.0, limit - number) for number in (bound.lower, bound.upper))
    where = f", {position(bound)}" if isfinite(bound.value) else ""
    return Miss(quantity, side="short of", key=key, most=most, least=least, unit="mm", where=where)


def _beyond(
    quantity: str, key: str, limit: float, bound: Enclosure | HeightRange, unit: str, where: str
) -> Miss:
    most, least = (max(0.0, number - limit) for number in (bound.upper, bound.lower))
    return Miss(quantity, side="beyond", key=key, most=most, least=least, unit=unit, where=f", {where}")


def _feature_advice(problem: Problem) -> Iterator[str]:
    """Yield a sentence for every free surface whose finest level would break limits.feature."""
    limit, lens = problem.limits.feature, problem.lens
    for name, spec in (("front", lens.front), ("rear", lens.rear)):
        free = spec.freeform
        if not limit or free is None:
            continue
        smallest = min(free.degree * 2 * h / n for h, n in zip(spec.half_width, free.spans))
        coarsest = smallest * NM_PER_MM / problem.source.wavelength
        if coarsest < limit:
            yield (
                f"limits.feature is {limit:g} wavelengths, but level 0 of lens.{name}.freeform has "
                f"{coarsest:.4g}: take fewer spans"
            )
        elif coarsest / 2**free.finest < limit:
            most = floor(log2(coarsest / limit))
            yield (
                f"limits.feature holds up to level {most}, but lens.{name}.freeform.max_level is "
                f"{free.finest}"
            )
