"""Rays that meet rough fronts, and how many of them a tracer leads to another meeting than the first.

`oracles.first_meetings` is the referee; where it disagrees with the tracer or leaves a ray open, and for a
sample, rational numbers decide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend
from optics.light.tracing import Tracer
from optics.scene.paths import LightPath
from optics.scene.receivers import receiver_at
from optics.scene.sources import Divergence, Profile, Rays, area_parts
from oracles.exact_meetings import ExactGraph
from oracles.first_meetings import MEETS, OPEN, first_meetings
from thbcad import Conic, FreeformSurface, KnotVector, Lens, THBSpace, THBSurface

HALF, SPANS = 5.0, 8  # mm, of the front; spans of level 0
BEFORE = 2.0  # mm, of a source before the lowest point of the front
STEEPEST_RAY = 0.02  # the least cosine between a ray and the axis
SAME = 1e-6  # mm, within which two meetings are the same: far below their distances, far above rounding
AT_ONCE = 1 << 18  # rays

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Judged:
    """How many rays there were, and how many of them came to another first meeting, or to no decision."""

    rays: int
    wrong: int
    undecided: int
    exact: int  # judged by rational numbers


def rough_front(slope: float, radius: float = np.inf, seed: int = 0) -> FreeformSurface:
    """Return a paraboloid with random coefficients on three levels, scaled to a root mean square slope."""
    rng = np.random.default_rng(seed)
    kv = KnotVector.uniform(3, SPANS, -HALF, HALF)
    space = THBSpace(kv, kv).refine({0: [(i, j) for i in range(2, SPANS - 2) for j in range(1, SPANS - 3)]})
    fine = space.cells[space.cells[:, 0] == 1, 1:]
    space = space.refine({1: [tuple(c) for c in fine.tolist() if sum(c) % 3 == 0 and c[0] < 2 * SPANS - 6]})
    sag = THBSurface(space, rng.standard_normal(space.dim))
    at = rng.uniform(-HALF, HALF, (2, 20_000))
    present = np.sqrt(np.mean(sag(*at, (1, 0)) ** 2 + sag(*at, (0, 1)) ** 2))
    sag = THBSurface(space, sag.coefficients * (slope / present))
    return FreeformSurface((HALF, HALF), Conic(radius, -1.0), sag)


def point_source(front: FreeformSurface, count: int, seed: int) -> Rays:
    """Return rays in random directions from a point on the axis."""
    origin = np.zeros((3, count))
    origin[2] = _heights(front)[0] - BEFORE
    return Rays(origin, _directions(np.random.default_rng(seed), count, 0.15), np.ones(count))


def extended_source(front: FreeformSurface, count: int, seed: int) -> Rays:
    """Return the rays of a Lambertian square of 1 mm."""
    distance = BEFORE - _heights(front)[0]
    some = 4 << (max(count, 4) // 4 - 1).bit_length()
    rays = next(
        area_parts((0.5, 0.5), distance, some, Divergence("lambertian", 85.0), Profile(), some, seed, some)
    )
    return next(rays.slices(count))


def oblique_rays(front: FreeformSurface, count: int, seed: int) -> Rays:
    """Return rays up to grazing through random points between the lowest and the highest point."""
    rng, (low, high) = np.random.default_rng(seed), _heights(front)
    direction = _directions(rng, count, STEEPEST_RAY)
    through = np.stack([*rng.uniform(-HALF, HALF, (2, count)), rng.uniform(low, high, count)])
    back = (through[2] - low + BEFORE) / direction[2]
    return Rays(through - back * direction, direction, np.ones(count))


SOURCES: dict[str, Callable[[FreeformSurface, int, int], Rays]] = {
    "point source": point_source,
    "extended source": extended_source,
    "oblique rays": oblique_rays,
}


def judge(
    backend: Backend, front: FreeformSurface, rays: Rays, sample: int = 0, proven: bool = True
) -> Judged:
    """Return how a tracer's first meetings with a front come out.

    sample : of the rays are judged by rational numbers, whatever intervals say.
    """
    parts = enumerate(rays.slices(AT_ONCE))
    judged = [_judge(backend, front, part, 0 if k else sample) for k, part in parts]
    return Judged(*(sum(column) for column in zip(*judged)))


def disagreeing(backend: Backend, front: FreeformSurface, rays: Rays, proven: bool) -> int:
    """Return for how many rays intervals prove that a tracer takes another meeting than the first."""
    resolved, _, _, agrees, opens = _compared(backend, front, rays, proven)
    return int((resolved & ~agrees & ~opens).sum())


def _judge(backend: Backend, front: FreeformSurface, rays: Rays, sample: int) -> tuple[int, int, int, int]:
    resolved, hit, path, agrees, _ = _compared(backend, front, rays, True)
    asked = resolved & ~agrees
    asked[:sample] = resolved[:sample]
    graph, wrong = ExactGraph(front), 0
    for k in np.flatnonzero(asked):
        fate, low, high = graph.first_meeting(rays.origin[:, k], rays.direction[:, k])
        same = float(low) - SAME <= path[k] <= float(high) + SAME
        wrong += not (same if hit[k] and fate == MEETS else hit[k] == (fate == MEETS))
    return len(rays.flux), wrong, int((~resolved).sum()), int(asked.sum())


def _compared(
    backend: Backend, front: FreeformSurface, rays: Rays, proven: bool
) -> tuple[Mask, Mask, Floats, Mask, Mask]:
    """Return (resolved, hit, path length, mm, agrees with the intervals, they leave it open)."""
    resolved, hit, path = _traced(backend, front, rays, proven)
    intervals = first_meetings(front, rays.origin, rays.direction)
    with np.errstate(invalid="ignore"):
        near = (path >= intervals.low - SAME) & (path <= intervals.high + SAME)
    meets, opens = intervals.fate == MEETS, intervals.fate == OPEN
    return resolved, hit, path, np.where(hit, meets & near, ~meets) & ~opens, opens


def _traced(backend: Backend, front: FreeformSurface, rays: Rays, proven: bool) -> tuple[Mask, Mask, Floats]:
    """Return (resolved, hit, path length, mm) of the front's meetings."""
    lens = Lens(front, FreeformSurface((50.0, 50.0)), 50.0, 1.5)
    tracer = Tracer(backend, LightPath.through(lens, receiver_at(200.0), 0.0), rays, proven)
    with backend.dr.suspend_grad():
        (hits,), _ = tracer.trace([sag.coefficients for sag in lens.sags])
        resolved, hit, x, y, z = (a.numpy() for a in (hits.found, hits.hit, hits.x, hits.y, hits.z))
    path = ((np.stack([x, y, z]) - rays.origin) * rays.direction).sum(axis=0)
    return resolved, hit, path


def _heights(front: FreeformSurface) -> tuple[float, float]:
    """Return heights below and above the front."""
    at = np.linspace(-HALF, HALF, 401)
    z = front(*(a.ravel() for a in np.meshgrid(at, at)))
    room = 0.05 * np.ptp(z)
    return float(z.min() - room), float(z.max() + room)


def _directions(rng: np.random.Generator, count: int, least: float) -> Floats:
    """Return unit vectors with random cosines to the axis, at least `least`."""
    cosine, turn = rng.uniform(least, 1, count), rng.uniform(0, 2 * np.pi, count)
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine])
