"""Light traced through front and rear of a lens, and how much of it the faces of a part stop."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isqrt
from typing import NamedTuple

import numpy as np

from optics.exchange.assemblies.blocked_paths import Obstacles, within_outline
from optics.light.tracing import Tracer
from optics.scene.receivers import Receiver
from optics.scene.sources import RayGrid, Rays
from optics.scene.system import System
from thbcad.certified import DIRECTIONS
from thbcad.checks import Floats
from thbcad.lens import Lens

RAYS = 1 << 20
SETS = 32  # independent ones, whose scatter is the error
SEED = 20
RULINGS = 513  # of an edge


class Paths(NamedTuple):
    """Light on its way: where it starts, meets front and rear, and ends, each (n, 3) mm, and flux (n,)."""

    start: Floats
    front: Floats
    rear: Floats
    end: Floats
    flux: Floats


@dataclass(frozen=True, eq=False)
class Obstruction:
    """What of a part may stop light.

    segments : Obstacles by the name of the segment of light in whose hull they lie
    voids : Obstacles within the glass that are no trims of its rim
    outlines : {"front" or "rear": segments of its edges in x and y}, of those that do not cover what is lit
    edges : Obstacles that are the lens's own edges: light in the glass that meets them is lost anyway
    """

    segments: Mapping[str, Obstacles]
    voids: Obstacles
    outlines: Mapping[str, Floats]
    edges: Obstacles


class Stopped(NamedTuple):
    """The light that a part stops.

    share : of the flux.  error : of the share, one standard error.  rays : that were traced.
    voided : rays that meet a face within the glass.
    """

    share: float
    error: float
    rays: int
    voided: int


def stopped_light(sets: Iterator[Paths], obstruction: Obstruction) -> Stopped:
    """Return what an obstruction stops of independent sets of light of one flux."""
    lost, all_of_it, count, voided = [], [], 0, 0
    for paths in sets:
        ends = {
            "source to front": (paths.start, paths.front),
            "front to rear": (paths.front, paths.rear),
            "rear to target": (paths.rear, paths.end),
        }
        stopped = np.zeros(len(paths.flux), dtype=bool)
        for name, obstacles in obstruction.segments.items():
            stopped |= obstacles.stop(*ends[name])
        for name, outline in obstruction.outlines.items():
            stopped |= ~within_outline(getattr(paths, name)[:, :2], outline)
        void = obstruction.voids.stop(paths.front, paths.rear)
        met = np.flatnonzero(stopped | void)
        own = met[obstruction.edges.stop(paths.front[met], paths.rear[met])]  # lost in the lens itself, too
        stopped[own] = void[own] = False
        voided += int(void.sum())
        lost.append(float(paths.flux[stopped | void].sum()))
        all_of_it.append(float(paths.flux.sum()))
        count += len(paths.flux)
    total = sum(all_of_it)
    if not total:
        return Stopped(0.0, np.inf, 0, 0)
    share = sum(lost) / total
    scatter = np.subtract(lost, share * np.array(all_of_it))
    error = float(np.sqrt(len(lost) * scatter.var(ddof=1))) / total if len(lost) > 1 else np.inf
    return Stopped(share, max(error, 1 / count), count, voided)


def sampled_light(system: System, target: Floats, heights: tuple[float, float]) -> Iterator[Paths]:
    """Yield sets of about a million rays of a source together, those that reach the lit part of the target.

    target : its supports, as of `LightHulls`.  heights : z of planes before and behind all of the part, mm.
    """
    backend = system.backend
    side = isqrt(RAYS // SETS)
    for rays in _light(system, side, heights[0]):
        tracer = Tracer(backend, system.path, rays)
        with backend.dr.suspend_grad():
            (front, rear), landing = tracer.trace_all()
            assert front is not None
            assert rear is not None
            values = [front.x, front.y, front.z, rear.x, rear.y, rear.z]
            values += [landing.x, landing.y, landing.p, landing.q, landing.flux]
            backend.dr.eval(values)
        met = np.stack(np.broadcast_arrays(*(value.numpy() for value in values)))
        yield _paths(rays, met, system.designed.thickness, target, system.target.receiver, heights[1])


def _light(system: System, side: int, low: float) -> Iterator[Rays]:
    """Yield independent sets of about side^2 rays; those of a beam start before all of the part."""
    source, fresh = system.source, np.random.default_rng(SEED)
    if source.collimated:
        grid = source.rays((side, side))
        assert isinstance(grid, RayGrid)
        for _ in range(SETS):
            yield _scattered(grid, system, low, fresh)
        return
    for parts in source.replicates(SETS, (side, side), fresh, RAYS):
        for part in parts:
            assert isinstance(part, Rays)
            far = source.from_afar
            back = np.maximum(part.origin[2] - low, 0.0) / part.direction[2] if far else 0.0
            yield Rays(part.origin - back * part.direction, part.direction, part.flux)


def _scattered(grid: RayGrid, system: System, low: float, fresh: np.random.Generator) -> Rays:
    """Return the rays of a grid, each at a random place between its neighbours: bars along the grid are met
    as often as others."""
    rays = grid.rays(low)
    for row, line in zip(rays.origin, (grid.x, grid.y)):
        row += fresh.uniform(-0.5, 0.5, row.size) * (line[1] - line[0])
    x, y = (row / half for row, half in zip(rays.origin, system.problem.source.half_width))
    return Rays(rays.origin, rays.direction, np.asarray(system.source.profile(x, y)))


def _paths(
    rays: Rays, met: Floats, thickness: float, target: Floats, receiver: Receiver, ahead: float
) -> Paths:
    """Return the paths of rays that reach the lit part of the target."""
    front, rear, (x, y, p, q, flux) = met[:3], met[3:6] + np.array([[0.0], [0.0], [thickness]]), met[6:]
    landing = np.tan(np.radians([x, y])) if receiver.far_field else np.stack([x, y])
    lit = (flux > 0) & (DIRECTIONS @ landing <= target[:, None]).all(axis=0)
    onward = receiver.pose.directions(np.stack([p, q, np.sqrt(np.maximum(1 - p * p - q * q, 0.0))]))
    length = np.maximum(ahead - rear[2], 0.0) / onward[2]
    if not receiver.far_field:
        there = np.stack(np.broadcast_arrays(*receiver.points(x, y)))
        length = np.minimum(length, np.linalg.norm(there - rear, axis=0))
    end = rear + length * onward
    start, front, rear, end = (rows[:, lit].T for rows in (rays.origin, front, rear, end))
    return Paths(start, front, rear, end, flux[lit])


def edge_triangles(lens: Lens) -> Floats:
    """Return triangles of the ruled edges of a lens or of its wall, (n, 3, 3), mm; none where front and rear
    have one size: then no path from the one to the other meets them."""
    if lens.front.half_width == lens.rear.half_width:
        return np.empty((0, 3, 3))
    unit = lens.rear.outline.scaled((1.0, 1.0))
    around = [piece(np.linspace(*piece.ends, RULINGS)) for piece in unit.pieces]
    rims = []
    for _, surface, vertex in lens.faces:
        x, y = np.concatenate(around, axis=1) * np.array(surface.half_width)[:, None]
        rims.append(np.column_stack([x, y, vertex + surface(x, y)]))
    low, high = rims
    return np.concatenate(
        [
            np.stack([low[:-1], low[1:], high[:-1]], axis=1),
            np.stack([high[1:], high[:-1], low[1:]], axis=1),
        ]
    )


def straight_paths(lens: Lens) -> Iterator[Paths]:
    """Yield straight paths from points of the front to points of the rear, for light that is not known."""
    fresh = np.random.default_rng(SEED)
    count = RAYS // SETS
    for _ in range(SETS):
        ends = []
        for _, surface, vertex in lens.faces:
            x, y = surface.outline.filled(
                *fresh.uniform(-1, 1, (2, count)) * np.array([surface.half_width]).T
            )
            ends.append(np.column_stack([x, y, vertex + surface(x, y)]))
        front, rear = ends
        yield Paths(front, front, rear, rear, np.ones(count))
