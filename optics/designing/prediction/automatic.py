"""Numbers that a problem leaves to the program: the base lens, the bounds of its sags, the levels.

All come from the slopes (zx, zy) that the transport map asks of the rear, or of a mirror's face.  The base is
the conic of curvature c = 1 / R whose own slopes are nearest to them,

    sum w |(zx, zy) - grad conic(x, y; c, K)|^2  ->  min,      K = -1 where it is left to the program:

a paraboloid lies in the space of the sag and is exact in every file.  The sag has to make up for the rest;
its bound is MARGIN times what that takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, inf, isinf, sqrt
from typing import Any, TypeVar

import numpy as np
from scipy.optimize import minimize_scalar

from optics.base.runtime import Backend, UserError
from optics.designing.optimisation import first_fit, transmitted_flux
from optics.designing.penalties import curvature_range
from optics.designing.prediction.freedom_note import gentler_geometries
from optics.designing.prediction.start_light import seen_level
from optics.designing.starts import RearLight, TransportStart, least_auto
from optics.scene.keys import AUTO
from optics.scene.problem import FINEST_AUTO, Front, MirrorElement, Problem, Rear, base_of
from optics.scene.system import System, solvable_system
from thbcad.checks import Floats
from thbcad.fitting import fit_slopes, seen_functions
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.sags import Conic
from thbcad.splines import KnotVector

Surface = TypeVar("Surface", "Front", "Rear")

CELLS = 64  # of the map that tells the base, in each direction: its curvature needs no detail
# of a map, of so many rounds, and a base: where rays spread in the lens, the map depends on the base (of the
# nine examples with such a base all digits are as after 5 and 5 rounds)
STEPS = 2, 4
LEAST_BENT = 0.9  # share of the light that must be within reach of a refracting surface
STEEPEST = 0.9  # of the slope that reflects parallel light totally: the conic's at the corner, at most
THINNEST = 0.2  # of the thickness: what the conic leaves at the corner, at least
FARTHEST = 0.5  # of the way to the target: where the conic may reach
ROOM = 0.4  # of the way to the target: the sag that a map may take before its bound is known
MARGIN = 1.5  # of z_freedom over the sag that the map asks for
NEEDED = 1.05  # the same where the lens is too thin for MARGIN
LEAST_FREEDOM = 0.01  # of the half-width: where a conic alone would do, the optimiser still needs some sag
KEPT = 0.9  # of the least thickness: the bounds of all sags together, at most, if the map allows
SPACE_LEVELS = 2  # of the mesh on which the sag is estimated


def resolved(system: System, backend: Backend) -> tuple[System, TransportStart | None]:
    """Return the system with numbers for all that is left to the program, and its transport start if known.

    A level is taken from the detail of the transport map (`TransportStart.level`), as far as a blur leaves it
    to see (`seen_level`).  A bound of the sags that the map on the meshes of the design does not keep to
    becomes one that it keeps to, where the lens is thick enough.

    Raises UserError : no transport map tells the base lens, or the lens that it tells cannot be.
    """
    asked, mapped = system.problem, system.problem.optimizer.start != "flat"
    bounded = mapped and any(freeform.z_freedom == AUTO for freeform in system.freeforms)
    if asked.optic.automatic:
        system = _with_base(system, backend)
    levels = any(freeform.max_level == AUTO for freeform in system.freeforms)
    if not levels and not bounded:
        return system, None
    start, level = TransportStart(system, backend), least_auto(system.freeforms[-1])
    if levels:
        level = seen_level(system, start, backend, level, start.level(level, FINEST_AUTO))
    levelled = _with_levels(system, level)
    start = start.levelled(levelled)
    if bounded:
        fits = first_fit(levelled, start), start.finest_fit()
        if start.helped(*fits):
            base = base_of(_based(system.problem))
            system = solvable_system(_with_numbers(asked, base, start.freedom(*fits)), system.own)
            levelled = _with_levels(system, level)
            start = TransportStart(levelled, backend)
    return levelled, start


def _with_levels(system: System, level: int) -> System:
    """Return the system with a level where it is left to the program."""
    problem = system.problem
    for spec in problem.free_optics:
        front, rear = _numbered(spec.front, "max_level", level), _numbered(spec.rear, "max_level", level)
        problem = problem.with_optic(spec, front=front, rear=rear)
    return system.with_prescription(problem=problem)


def _with_base(system: System, backend: Backend) -> System:
    """Return the system with a base lens and bounds of its sags."""
    asked, base = system.problem, base_of(_based(system.problem))
    widest = min(asked.optic.thickness, ROOM * system.problem.throw)
    for rounds in STEPS:
        wide = solvable_system(_with_numbers(asked, base, widest), system.own)
        if not wide.parallel:
            transmitted_flux(wide, backend)  # refuses a lens without light, which has no map
        start = TransportStart(wide, backend, CELLS, rounds)
        if start.bent < LEAST_BENT:
            nearest = " or ".join(gentler_geometries(wide, start))
            raise UserError(
                f'no transport map tells what "{AUTO}" stands for: the surface can send only '
                f"{start.bent:.0%} of the light to where it should go; give radius, conic and z_freedom of "
                f"the {asked.optic.noun} as numbers, or {asked.target.gentler}"
                + f", such as by {nearest}"
                * bool(nearest)
            )
        light, slopes = start.rear_slopes()
        base = _nearest_base(asked, light, slopes, system.problem.throw)
    based = solvable_system(_with_numbers(asked, base, widest), system.own)
    return solvable_system(_with_numbers(asked, base, _freedom(based, light, slopes)), system.own)


def _nearest_base(
    asked: Problem, light: RearLight, slopes: Sequence[Floats], throw: float
) -> tuple[float, float]:
    """Return radius and conic constant of the base."""
    surface = _based(asked)
    constant = -1.0 if isinstance(surface.conic, str) else surface.conic
    if not isinstance(surface.radius, str):
        return surface.radius, constant
    x, y = light.x[:, None], light.y[None, :]

    def misfit(c: float) -> float:
        conic = Conic(1 / c if c else inf, constant)
        return float(
            sum(np.sum(light.weight * (s - conic(x, y, d)) ** 2) for s, d in zip(slopes, ((1, 0), (0, 1))))
        )

    bounds = _curvatures(asked, constant, throw)
    found = minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-6 * np.ptp(bounds)})
    # a plane does where the least sag makes up for the conic
    flattest = LEAST_FREEDOM * max(surface.half_width)
    if abs(found.x) * hypot(*surface.half_width) ** 2 / 2 < flattest:
        return inf, constant
    radius = float(f"{1 / found.x:.3g}")
    within = bounds[0] <= 1 / radius <= bounds[1]  # rounding may exceed a limit on curvature
    return radius if within else 1 / found.x, constant


def _curvatures(problem: Problem, constant: float, throw: float) -> tuple[float, float]:
    """Return the least and the greatest curvature that the base may have, within the limits on curvature.

    A slope s at the radius r belongs to c = s / (r sqrt(1 + (1 + K) s^2)), a height z to
    c = 2 z / (r^2 + (1 + K) z^2).
    """
    spec, k = problem.optic, 1 + constant
    r = hypot(*spec.rear.half_width)
    if isinstance(spec, MirrorElement):
        steep, low, high = STEEPEST, -FARTHEST * throw, (1 - THINNEST) * spec.thickness
    else:
        steep = STEEPEST / sqrt(spec.known_index**2 - 1)
        at_front = float(Conic(*base_of(spec.front))(*spec.front.half_width))
        low, high = (THINNEST - 1) * (spec.thickness - at_front), FARTHEST * throw
    most = steep / (r * sqrt(max(1 + k * steep**2, 1e-6)))
    least = -most if isinf(low) else max(-most, 2 * low / max(r**2 + k * low**2, 1e-6))
    most = most if isinf(high) else min(most, 2 * high / max(r**2 + k * high**2, 1e-6))
    lower, upper = curvature_range(problem.limits, "front" if isinstance(spec, MirrorElement) else "rear")
    return max(least, lower), min(most, upper)


def _freedom(system: System, light: RearLight, slopes: Sequence[Floats]) -> float:
    """Return the bound of the sags, mm, on the base lens of a system.

    It is MARGIN times the greatest coefficient of a sag with the slopes that the base lacks.  Where the lens
    is too thin for that, it is what keeps the surfaces apart, but not less than the map needs.
    """
    lens = system.base
    shaped: FreeformSurface = getattr(lens, system.shaped)
    x, y = light.x[:, None], light.y[None, :]
    space = _estimating(lens.sags[-1].space, light)
    zx, zy = (s - shaped.conic(x, y, d) for s, d in zip(slopes, ((1, 0), (0, 1))))
    sag = fit_slopes(space, light.x, light.y, zx, zy, light.weight)
    asked = float(np.abs(sag.coefficients[seen_functions(space, light.x, light.y)]).max())
    wanted = max(MARGIN * asked, LEAST_FREEDOM * max(shaped.half_width))
    room = KEPT * lens.least_thickness().lower / len(lens.sags)
    return float(f"{min(wanted, max(room, NEEDED * asked)):.2g}")


def _estimating(space: THBSpace, light: RearLight) -> THBSpace:
    """Return the mesh on which the sag is estimated, with fewer spans than the map has cells."""

    def knots(kv: KnotVector, cells: int) -> KnotVector:
        spans = min(kv.spans << SPACE_LEVELS, 3 * cells // 4 - kv.degree)
        return KnotVector.uniform(kv.degree, spans, kv.start, kv.stop)

    return THBSpace(knots(space.kv_u, len(light.x)), knots(space.kv_v, len(light.y)))


def _with_numbers(problem: Problem, base: tuple[float, float], freedom: float) -> Problem:
    """Return the problem with numbers for the base lens and the bounds of its sags."""
    spec = problem.optic
    front, rear = base_of(spec.front), base
    if isinstance(spec, MirrorElement):
        front, rear = base, base_of(spec.rear)
    return problem.with_optic(
        front=replace(_numbered(spec.front, "z_freedom", freedom), radius=front[0], conic=front[1]),
        rear=replace(_numbered(spec.rear, "z_freedom", freedom), radius=rear[0], conic=rear[1]),
    )


def _based(problem: Problem) -> Front | Rear:
    """Return the surface whose conic is chosen: the rear of a lens, the face of a mirror."""
    optic = problem.optic
    return optic.front if isinstance(optic, MirrorElement) else optic.rear


def _numbered(surface: Surface, key: str, number: Any) -> Surface:
    """Return a surface with a number for a key of its spline that is left to the program."""
    if surface.freeform is None or getattr(surface.freeform, key) != AUTO:
        return surface
    return replace(surface, freeform=replace(surface.freeform, **{key: number}))
