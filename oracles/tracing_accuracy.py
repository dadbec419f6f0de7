"""How far traced rays are from exact ones where tracing is hardest, and how many come to a wrong end.

The referee traces the same data in 60 decimal digits.  An error counts in roundoffs: 1 is what comes of
moving every datum - ray, coefficients of the surfaces, index - and the result by one unit of roundoff (2^-53,
or 2^-24 in single precision). A ray makes some hundred roundings, each like one of a datum, of which there
are 19.  A fate is wrong where it differs from the exact one although no datum's move by LIMIT roundoffs would
change it; where it is a matter of meeting a surface or not, by the tracer's resolution.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend
from optics.light.tracing import Tracer
from optics.scene.paths import LightPath
from optics.scene.problem import SUN
from optics.scene.ray_files import RaySet
from optics.scene.receivers import receiver_at
from optics.scene.sources import (
    Divergence,
    Profile,
    RayGrid,
    Rays,
    area_parts,
    placed_rays,
    point_rays,
)
from oracles.exact_rays import (
    ARRIVES,
    BESIDE,
    MISSED,
    TOTAL,
    Quadric,
    Setup,
    difference,
    exact_trace,
    fates_nearby,
    sensitivity,
)
from thbcad import Pose

LIMIT = 6  # roundoffs: a hundred roundings over 19 data
INDEX, CRITICAL = 1.5, np.arcsin(1 / 1.5)
FRONT, REAR = Quadric((0.0, 0.02, 0.01, -0.02, -0.01), 8.0), Quadric((0.0, 0.05, -0.03, 0.01, -0.02), 9.0)
FLAT = Quadric((0.0, 0.0, 0.0, 0.0, 0.0), 8.0)
COUNT = 40  # rays


@dataclass(frozen=True, eq=False)
class Case:
    """Rays of one kind.

    spline : degree, spans, share and depth of `Quadric.surface`.  strict : every fate must be the exact one.
    grid : the same rays as the tracer takes parallel ones.
    """

    name: str
    setup: Setup
    spline: dict[str, float] = field(default_factory=dict)
    strict: bool = False
    grid: RayGrid | None = None


@dataclass(frozen=True)
class Found:
    """Worst error of landing points and shares, in roundoffs, and rays that end wrongly, undecided or not in
    numbers."""

    points: float
    shares: float
    wrong: int
    unresolved: int
    numberless: int


def cases() -> Iterator[Case]:
    """Yield every Case."""
    plain = Setup(FRONT, REAR, 5.0, INDEX, 100.0, *oblique(20.0))
    yield Case("oblique rays", plain)
    for degree in range(2, 11):
        yield Case(f"degree {degree}", plain, {"degree": degree, "spans": 5, "share": 0.0})
    for factor in (1e-6, 1e-3, 1e3, 1e6):
        yield Case(f"lengths times {factor:g}", plain.scaled(factor))
    for angle in (89.9, 89.999, 89.99999):
        yield Case(f"incidence at {angle} degrees", grazing(angle))
    yield Case("total reflection on the verge", verge())
    yield Case("tangent rays", tangent())
    yield Case("along knot lines", along_knots(), {"depth": 2, "share": 0.0})
    yield Case("rim of the front", rim(FLAT, Quadric(REAR.terms, 12.0), 8.0))
    yield Case("rim of the rear", rim(Quadric(FLAT.terms, 12.0), Quadric(REAR.terms, 8.0), 8.0))
    for slope in (45.0, 60.0, 75.0):
        yield Case(f"slopes to {slope:g} degrees", steep(slope))
    for distance in (1e-6, 0.0):
        yield Case(f"source {distance:g} mm before the front", touching(distance), strict=True)
    yield from sources()


def measure(backend: Backend, case: Case) -> Found:
    """Return how a case comes out."""
    unit = float(np.finfo(backend.dtype).eps) / 2
    rays = Rays(case.setup.origin, case.setup.direction, np.ones(case.setup.origin.shape[1]))
    traced = case.grid or rays
    # the tracer rounds the rays to its precision: the exact ones are those
    rounded = (a.astype(backend.dtype).astype(float) for a in (rays.origin, rays.direction))
    setup = replace(case.setup, **dict(zip(("origin", "direction"), rounded)))
    lens = setup.lens(**case.spline)
    tracer = Tracer(
        backend, LightPath.through(lens, receiver_at(setup.thickness + setup.distance), 0.0), traced
    )
    _, landing = tracer.trace()
    front, rear = landing.passages
    every = front.found, front.hit, rear.found, rear.hit, rear.goes_on, landing.x, landing.y, landing.flux
    decided, met, found, hit, refracted, *values = (
        np.broadcast_to(np.asarray(a.numpy()), len(rays.origin[0])) for a in every
    )
    fate = np.where(met, np.where(hit, np.where(refracted, ARRIVES, TOTAL), MISSED), BESIDE)
    exact, scales = exact_trace(setup), sensitivity(setup)
    rounded, resolved = fates_nearby(setup, LIMIT * unit), fates_nearby(setup, backend.resolution)
    both = (fate == ARRIVES) & (exact.fate == ARRIVES) & ~(rounded == TOTAL).any(axis=0)
    beside = np.isin(fate, (BESIDE, MISSED)) | np.isin(exact.fate, (BESIDE, MISSED))
    sure = (np.where(beside, resolved, rounded) == exact.fate).all(axis=0) | case.strict
    wrong = (fate != exact.fate) & sure
    errors = [
        _worst(e, f, s * unit, both) for e, f, s in zip((exact.x, exact.y, exact.share), values, scales)
    ]
    return Found(
        max(errors[:2]),
        errors[2],
        int(wrong.sum()),
        int((~decided | (met & ~found)).sum()),
        int((~np.isfinite(values).all(axis=0)).sum()),
    )


def _worst(
    exact: NDArray[np.object_],
    found: NDArray[np.floating],
    scale: NDArray[np.float64],
    mask: NDArray[np.bool_],
) -> float:
    return float((difference(exact[mask], found[mask]) / scale[mask]).max(initial=0.0))


def oblique(most: float, z: float = -9.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rays up to `most` degrees from the axis."""
    rng = np.random.default_rng(1)
    cosine, turn = rng.uniform(np.cos(np.radians(most)), 1, COUNT), rng.uniform(0, 2 * np.pi, COUNT)
    sine = np.sqrt(1 - cosine**2)
    return np.stack([*rng.uniform(-4, 4, (2, COUNT)), np.full(COUNT, z)]), np.stack(
        [sine * np.cos(turn), sine * np.sin(turn), cosine]
    )


def grazing(angle: float) -> Setup:
    """Return rays that meet a plane front 2 mm further on, and a rear tilted towards them."""
    rng, radians = np.random.default_rng(2), np.radians(angle)
    origin = np.stack([*rng.uniform(-3, 3, (2, COUNT)), np.full(COUNT, -2 / np.tan(radians))])
    direction = np.repeat([[np.sin(radians)], [0.0], [np.cos(radians)]], COUNT, axis=1)
    return Setup(FLAT, Quadric((0.0, -0.3, 0.05, 0.01, 0.01), 9.0), 5.0, INDEX, 100.0, origin, direction)


def verge() -> Setup:
    """Return rays that meet a plane rear at the critical angle plus or minus 1e-3 ... 1e-15."""
    away = np.concatenate([sign * np.logspace(-3, -15, COUNT // 2) for sign in (1, -1)])
    origin = np.stack([np.linspace(-3, 3, COUNT), np.linspace(2, -2, COUNT), np.full(COUNT, -9.0)])
    direction = np.stack([INDEX * away, 0 * away, np.sqrt(1 - (INDEX * away) ** 2)])
    return Setup(
        FLAT,
        Quadric((0.0, -float(np.tan(CRITICAL)), 0.0, 0.0, 0.0), 9.0),
        12.0,
        INDEX,
        100.0,
        origin,
        direction,
    )


def tangent() -> Setup:
    """Return rays at 40 degrees in the glass that touch the hollow of a paraboloid, or pass it by 1e-3 ...
    1e-12 mm."""
    inside, bend, thickness = np.radians(40.0), 0.1, 12.0
    x = 1 / np.tan(inside) / (2 * bend)
    foot = x - (bend * x * x + thickness) * np.tan(inside)
    aside = np.concatenate([sign * np.logspace(-3, -12, COUNT // 2) for sign in (1, -1)])
    outside = np.arcsin(INDEX * np.sin(inside))
    direction = np.repeat([[np.sin(outside)], [0.0], [np.cos(outside)]], COUNT, axis=1)
    origin = np.stack([foot + aside - 0.1 * np.tan(outside), 0 * aside, np.full(COUNT, -0.1)])
    return Setup(
        Quadric(FLAT.terms, 12.0),
        Quadric((0.0, 0.0, 0.0, bend, bend), 9.0),
        thickness,
        INDEX,
        100.0,
        origin,
        direction,
    )


def along_knots() -> Setup:
    """Return rays in planes that hold knot lines, through corners of cells, and along the axis there."""
    knots = np.linspace(-8, 8, 17)
    x, y = (a.ravel() for a in np.meshgrid(knots[::2], knots[::2]))
    lean = np.tile([0.0, 0.2, -0.2], len(x))[: len(x)]
    origin = np.stack([x, y, np.full(len(x), -9.0)])
    direction = np.stack([0 * lean, lean, np.sqrt(1 - lean**2)])
    return Setup(FLAT, Quadric((0.0, 0.0, 0.0, 0.01, -0.02), 8.0), 5.0, INDEX, 100.0, origin, direction)


def rim(front: Quadric, rear: Quadric, half: float) -> Setup:
    """Return rays that pass a rim at 0, 1e-15 ... 1e-9 and 1e-3 mm, along the axis and aslant."""
    aside = np.concatenate(
        [[0.0], *(sign * np.array([2e-15, 1e-14, 1e-12, 1e-10, 1e-9, 1e-3]) for sign in (1, -1))]
    )
    x = np.concatenate([half + aside, half + aside - 9 * 0.1 / np.sqrt(0.99)])
    lean = np.repeat([0.0, 0.1], len(aside))
    origin = np.stack([x, np.linspace(-3, 3, len(x)), np.full(len(x), -9.0)])
    return Setup(front, rear, 5.0, INDEX, 100.0, origin, np.stack([lean, 0 * lean, np.sqrt(1 - lean**2)]))


def steep(slope: float) -> Setup:
    """Return rays along the axis that meet a hollow front whose slope reaches `slope` degrees at the middle
    of its edges."""
    bend = -float(np.tan(np.radians(slope))) / 16
    x = np.linspace(-8, 8, COUNT)
    origin = np.stack([x, np.zeros(COUNT), np.full(COUNT, -60.0)])
    direction = np.repeat([[0.0], [0.0], [1.0]], COUNT, axis=1)
    return Setup(
        Quadric((0.0, 0.0, 0.0, bend, bend), 8.0),
        Quadric((0.0, 0.01, 0.0, -0.002, -0.001), 40.0),
        5.0,
        INDEX,
        100.0,
        origin,
        direction,
    )


def touching(distance: float) -> Setup:
    """Return rays up to 80 degrees from a source so close to a plane front."""
    origin, direction = oblique(80.0, -distance)
    return Setup(FLAT, Quadric((0.0, 0.05, -0.03, -0.01, -0.01), 14.0), 9.0, INDEX, 100.0, origin, direction)


def sources() -> Iterator[Case]:
    """Yield sources before lenses: a point, a square of 1 mm, the same of a file, a beam, and the sun."""
    target, far = 300.0, np.inf
    point = point_rays(60.0, 1.0, 30.0, 0.0, (7, 6), (0.0, 0.0))
    square = next(area_parts((0.5, 0.5), 2.0, 1.0, Divergence("lambertian", 89.9), Profile(), 64, 0, 64))
    front, dome = Quadric(FLAT.terms, 40.0), Quadric((0.0, 0.0, 0.0, -0.1, -0.1), 5.0)
    rears = Quadric((0.0, 0.0, 0.0, -1 / 140, -1 / 140), 45.0), Quadric((0.0, 0.0, 0.0, -0.05, -0.05), 8.0)
    for name, distance in (("", target), (" in the far field", far)):
        lit = Setup(front, rears[0], 35.0, INDEX, distance, point.origin, point.direction)
        yield Case(f"point source{name}", lit)
        lit = Setup(dome, rears[1], 5.0, INDEX, distance, square.origin, square.direction)
        yield Case(f"extended source{name}", lit)
        held = RaySet(square.origin.T, square.direction.T, square.flux)
        read = placed_rays(held, Pose.at(), 1.0)
        lit = Setup(dome, rears[1], 5.0, INDEX, distance, read.origin, read.direction)
        yield Case(f"rays of a file in single precision{name}", lit)
    axis = np.linspace(-9.5, 9.5, 7)
    grid = RayGrid(axis, axis, np.ones((7, 7)))
    sun = next(area_parts((9.5, 9.5), 10.0, 1.0, Divergence("sun", SUN), Profile(), 64, 0, 64))
    beam, rear = grid.rays(-10.0), Quadric((0.0, 0.0, 0.0, 1 / 60, 1 / 60), 10.0)
    for name, distance in (("", target), (" in the far field", far)):
        lit = Setup(Quadric(FLAT.terms, 10.0), rear, 8.0, INDEX, distance, beam.origin, beam.direction)
        yield Case(f"parallel beam{name}", lit, {"depth": 2}, grid=grid)
        lit = Setup(Quadric(FLAT.terms, 10.0), rear, 8.0, INDEX, distance, sun.origin, sun.direction)
        yield Case(f"light of the sun{name}", lit, {"depth": 2})
