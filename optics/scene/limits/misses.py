"""The problem's limits of manufacture: by how much a lens may miss them, and advice before a design."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import floor, inf, isfinite, log2, nextafter

from optics.base.runtime import Check, UserError
from optics.scene.limits.manufacture_text import position, positions
from optics.scene.problem import Freeform, Limits, Optic, Problem
from thbcad.certified import Enclosure
from thbcad.lens import (
    NM_PER_MM,
    HeightRange,
    Lens,
    Manufacturability,
    SurfaceMetrics,
    manufacturability,
    mass,
)

THICKNESSES = {
    "thickness": "thickness",
    "centre_thickness": "centre thickness",
    "edge_thickness": "edge thickness",
}
ROUNDING = 1e-12  # of a limit: a height that is the limit by its formula is within it


@dataclass(frozen=True)
class Miss:
    """How far a quantity lies on the wrong side of limits.`key`: at most `most`, at least `least`.

    Both are 0 within the limit.

    wanted : the limit.  beyond : the limit is an upper one.  surface : "front", "rear", or "" for the lens.
    """

    quantity: str
    key: str
    wanted: float
    most: float
    least: float
    unit: str
    beyond: bool = False
    surface: str = ""
    where: str = ""

    @property
    def side(self) -> str:
        return "beyond" if self.beyond else "short of"

    @property
    def got(self) -> float:
        """The certified number that is compared with the limit, where that is missed."""
        return self.wanted + self.most if self.beyond else self.wanted - self.most


def require_limits(problem: Problem) -> None:
    """Raise UserError where a limit needs a key that is missing, or contradicts another limit."""
    limits = problem.limits
    for key in THICKNESSES:
        if getattr(limits, key) > limits.greatest_thickness:
            raise UserError(
                f"limits.{key} of {getattr(limits, key):g} mm is more than limits.greatest_thickness of "
                f"{limits.greatest_thickness:g} mm; lower the one or raise the other"
            )
    low, high = limits.envelope
    least = max(limits.thickness, limits.centre_thickness, limits.edge_thickness)
    if high - low <= least:
        raise UserError(
            f"limits.envelope from z = {low:g} to {high:g} mm must be higher than the least thickness, "
            f"which is {least:g} mm; list the lower end first, and widen it"
        )
    for optic in (problem.free_optics or (problem.optic,)) if isfinite(limits.mass) else ():
        if not optic.density:
            raise UserError(
                f"limits.mass of {limits.mass:g} g needs {optic.key('density')}, the density in g/cm^3, "
                "which is 0 (unknown)"
            )


def limit_checks(problem: Problem, metrics: Manufacturability) -> list[Check]:
    """Return by how much the lens may miss each of the problem's limits, with the position.

    The numbers come from certified bounds, that of the mass from quadrature.
    """
    return [
        Check(f"{m.quantity} {m.side} limits.{m.key}{m.where}", m.most, 0, m.unit)
        for m in limit_misses(problem, metrics)
    ]


def limit_advice(problem: Problem, lens: Lens, made: tuple[int, float] = (1, 0.0)) -> list[str]:
    """Return a sentence for every limit that the lens misses without its sags.

    Levels too fine for limits.feature get one too.

    made : (n, more), where n times the lens's volume, and mm^3 more, are made.
    """
    if problem.limits == type(problem.limits)():
        return []
    bare = Lens(replace(lens.front, sag=None), replace(lens.rear, sag=None), lens.thickness, lens.index)
    metrics, (count, more) = manufacturability(bare), made
    metrics = replace(metrics, volume=count * metrics.volume + more)
    missed = [m for m in limit_misses(problem, metrics) if m.least > 0]
    sentences = [
        f"before optimisation the {m.quantity} is {m.least:.4g} {m.unit} {m.side} limits.{m.key}{m.where}"
        for m in missed
    ]
    return sentences + list(_feature_advice(problem))


def limit_misses(problem: Problem, metrics: Manufacturability) -> Iterator[Miss]:
    """Yield the Miss of every limit that is set, also of those that are kept."""
    limits, optic = problem.limits, problem.optic
    for key, quantity in THICKNESSES.items():
        if getattr(limits, key):
            yield _short(quantity, key, getattr(limits, key), getattr(metrics, key))
    if isfinite(limits.greatest_thickness):
        greatest = limits.greatest_thickness
        yield _beyond("thickness", "greatest_thickness", greatest, metrics.greatest_thickness)
    low, high = limits.envelope
    if isfinite(low):
        quantity = f"least z of the {optic.face_name('front')}"
        yield _short(quantity, "envelope", low, metrics.front.heights.least, "front")
    if isfinite(high):
        z, top = optic.thickness, metrics.rear.heights.greatest
        top = replace(top, lower=z + top.lower, upper=float(nextafter(z + top.upper, inf)))
        yield _beyond(f"greatest z of the {optic.face_name('rear')}", "envelope", high, top, "rear")
    for name, surface in metrics.surfaces.items():
        face = optic.face_name(name)
        if name in optic.free:
            for miss in _free_misses(face, surface, limits, problem.source.wavelength):
                yield replace(miss, surface=name)
        if limits.slope < 90:
            miss = _beyond(f"slope of the {face}", "slope", limits.slope, surface.slope, name)
            yield replace(miss, unit="degrees")
        if isfinite(limits.sag_range):
            yield _beyond(
                f"range of heights of the {face}", "sag_range", limits.sag_range, surface.heights, name
            )
    if isfinite(limits.mass):
        amount = max(0.0, mass(metrics.volume, optic.density) - limits.mass)
        yield Miss("mass", "mass", limits.mass, most=amount, least=amount, unit="g", beyond=True)


def _free_misses(face: str, surface: SurfaceMetrics, limits: Limits, wavelength: float) -> Iterator[Miss]:
    """Yield the limits that hold for free surfaces.  face : what sentences call it."""
    if limits.radius:
        least = min((surface.concave, surface.convex), key=lambda radius: radius.lower)
        yield _short(f"radius of the {face}", "radius", limits.radius, least)
    if limits.concave_radius:
        quantity = f"concave radius of the {face}"
        yield _short(quantity, "concave_radius", limits.concave_radius, surface.concave)
    if limits.feature and surface.feature is not None:
        amount = max(0.0, limits.feature - surface.feature.wavelengths(wavelength))
        quantity, where = f"smallest feature of the {face}", f", on level {surface.feature.level}"
        yield Miss(quantity, "feature", limits.feature, amount, amount, unit="wavelengths", where=where)


def _missed(amount: float, limit: float) -> float:
    """Return an amount where it is more than rounding of the limit, else 0."""
    return amount if amount > ROUNDING * abs(limit) else 0.0


def _short(quantity: str, key: str, limit: float, bound: Enclosure, surface: str = "") -> Miss:
    most, least = (_missed(limit - number, limit) for number in (bound.lower, bound.upper))
    where = f", {position(bound)}" if isfinite(bound.value) else ""
    return Miss(quantity, key, limit, most, least, unit="mm", surface=surface, where=where)


def _beyond(quantity: str, key: str, limit: float, bound: Enclosure | HeightRange, surface: str = "") -> Miss:
    most, least = (_missed(number - limit, limit) for number in (bound.upper, bound.lower))
    where = f", {positions(bound) if isinstance(bound, HeightRange) else position(bound)}"
    return Miss(quantity, key, limit, most, least, unit="mm", beyond=True, surface=surface, where=where)


def feature_levels(problem: Problem) -> list[int]:
    """Return the finest level of every free surface along the path that limits.feature leaves of max_level.

    It is 0 where even level 0 has smaller features.
    """
    return [level for optic in problem.free_optics for *_, level in _features(problem, optic)]


def _features(problem: Problem, optic: Optic) -> Iterator[tuple[str, Freeform, float, int]]:
    """Yield key, settings, the smallest feature of level 0 in wavelengths, and the level of `feature_levels`,
    of every free surface."""
    limit = problem.limits.feature
    for name, free in optic.free.items():
        half_width = getattr(optic, name).half_width
        smallest = min(free.degree * 2 * h / n for h, n in zip(half_width, free.spans))
        size = smallest * NM_PER_MM / problem.source.wavelength
        level = max(0, min(free.finest, floor(log2(size / limit)))) if limit else free.finest
        yield optic.key(name), free, size, level


def _feature_advice(problem: Problem) -> Iterator[str]:
    """Yield a sentence for every free surface whose finest level would break limits.feature."""
    limit = problem.limits.feature
    for key, free, coarsest, level in _features(problem, problem.optic):
        if coarsest < limit:
            yield (
                f"limits.feature is {limit:g} wavelengths, but level 0 of "
                f"{key}.freeform has {coarsest:.4g}: take fewer spans"
            )
        elif level < free.finest:
            yield (
                f"limits.feature holds up to level {level}, but "
                f"{key}.freeform.max_level is {free.max_level}: the mesh "
                f"stays at level {level}"
            )
