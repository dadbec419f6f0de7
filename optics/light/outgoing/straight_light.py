"""Light on its straight ways through air: from an element to the next, and from the last to the receiver.

One trace tells all of them.  Sharp light is traced by the corners of its cells, and other light by rays as
they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from math import inf, isinf, pi, sqrt
from operator import and_

import numpy as np
from scipy.spatial import ConvexHull

from optics.base.runtime import Backend, DrArray, UserError
from optics.light.intersections import Hits
from optics.light.tracing import Landing, Tracer
from optics.scene.paths import LightPath
from optics.scene.problem import Problem
from optics.scene.receivers import Plane
from optics.scene.sources import SourceCells
from optics.scene.system import System
from thbcad.checks import Floats, Integers
from thbcad.poses import Pose

COARSER = 2  # cells in each direction, with which planes are looked at before the last one
RAYS_IN_DISK = 16, 400  # at the irradiance of the front: cells, and rays at random, whose noise is 5 %
LEAST_RAYS = 4  # on the front, that tell how much of it is lit
DARK = "no light leaves the lens by front and rear; check the source and the lens"
FAR = 10_000.0  # mm behind the last face, as far as light to the far field is followed


@dataclass(frozen=True, eq=False)
class StraightLight:
    """Light on a straight way through air: cells by the rays of their four corners, or rays alone.

    Its frame has the origin at the vertex of the face that light leaves.  +z goes along the mean direction
    of the light to the next face, and at last to the middle of the receiver.

    face : its number along the path.
    start : (2, 4 or 1, n), x and y on the plane z0, mm.  slope : the same, tangents.  flux : (n,) W.
    middle : of cells, (start, slope), (2, n) each.
    begin, end : (n,) mm, z where they leave the face and where they meet the next one, inf beside it.
    z0, depth : mm, the greatest z of points where rays leave, and the average.
    nearest, farthest : mm, between which z this light may be concentrated.
    disk : mm, the least in which rays tell the irradiance.
    """

    face: int
    start: Floats
    slope: Floats
    middle: tuple[Floats, Floats]
    flux: Floats
    begin: Floats
    end: Floats
    z0: float
    depth: float
    nearest: float
    farthest: float
    disk: float

    def of(self, some: Integers) -> StraightLight:
        """Return some of the cells or rays.  some : their numbers."""
        return replace(
            self,
            start=self.start[:, :, some],
            slope=self.slope[:, :, some],
            middle=(self.middle[0][:, some], self.middle[1][:, some]),
            flux=self.flux[some],
            begin=self.begin[some],
            end=self.end[some],
        )

    def around(self, z: float, margin: float) -> StraightLight:
        """Return what is on its way at a height, or no farther from there than a margin, mm."""
        there = (self.begin <= z + margin) & (self.end >= z - margin)
        return self if there.all() else self.of(np.flatnonzero(there))


def faces_into_air(problem: Problem) -> list[int]:
    """Return the numbers of the faces along the path behind which light goes through air."""
    return [k for k, face in enumerate(problem.faces_met) if not face.into_glass]


def straight_light(
    system: System, backend: Backend, count: int
) -> tuple[float, list[tuple[StraightLight, StraightLight]]]:
    """Return the irradiance of what is lit of the front, W/mm^2, and the light of every way through air.

    The light has no losses.  It is given in all cells, and in cells that are COARSER times as large.

    count : of cells of sharp light in each direction; its square is the number of rays of other light.

    Raises UserError : no light leaves the lens.
    """
    cells = None if system.source.extended else system.source.cells((count, count))
    rays = system.source.rays((count, count)) if cells is None else cells.rays()
    path = system.path.without_absorption().without_reflection()
    tracer, faces = Tracer(backend, path.onto(Plane(path.leaving)), rays), faces_into_air(system.problem)
    with backend.dr.suspend_grad():
        hits, landing = tracer.trace_all()
        every = backend.dr.ones(backend.dr.mask_t(backend.Float), rays.flux.size)
        values = [_on_front(system, path, hits, every), _behind_last(path, hits, landing, every)]
        values += [_between(k, hits, landing, every) for k in faces[:-1]]
        backend.dr.eval(values)
    lit, last, *others = ([np.broadcast_to(a.numpy(), rays.flux.size) for a in each] for each in values)
    traced = [_toward_next(path, k, *each) for k, each in zip(faces, others)]
    traced.append((*last, np.full(rays.flux.size, inf)))
    emitted = (
        {1: np.ravel(rays.flux)} if cells is None else {k: _merged(cells.emitted, k) for k in (1, COARSER)}
    )
    front, disk = _front([_parts(a, cells, 1) for a in lit], emitted[1], RAYS_IN_DISK[cells is None])
    ways = []
    for k, way in zip(faces, traced):
        each = [
            _light(path, k, [_parts(a, cells, step) for a in way], flux, disk)
            for step, flux in emitted.items()
        ]
        ways.append((each[0], replace(each[-1], depth=each[0].depth)))
    return front, ways


def _on_front(system: System, path: LightPath, hits: Sequence[Hits | None], every: DrArray) -> list[DrArray]:
    """Return x and y of rays on the front, mm, and which meet it.  every : the mask of all rays."""
    first = next(h for h in hits if h is not None)
    x, y = first.x, first.y
    if system.source.beam:  # a face that is turned has less light on its area than the beam
        there = path.surfaces[0].pose.points((first.x, first.y, first.z))
        x, y, _ = system.source.frame.inverse().points(there)
    return [x, y, every & first.hit]


def _behind_last(
    path: LightPath, hits: Sequence[Hits | None], landing: Landing, every: DrArray
) -> list[DrArray]:
    """Return z where rays leave the last face, x and y at z = 0, mm, their tilt there, and which arrive."""
    last = hits[-1]
    assert last is not None
    z = (path.leaving.inverse() @ path.surfaces[-1].pose).points((last.x, last.y, last.z))[2]
    return [z, landing.x, landing.y, landing.p, landing.q, every & landing.arrives]


def _between(k: int, hits: Sequence[Hits | None], landing: Landing, every: DrArray) -> list[DrArray]:
    """Return what is known of rays from a face to the next, in the frame of that one.

    It is (origin, direction, flux, which leave the face, where they meet the next, which do): 12 arrays.
    """
    coming, met, passed = landing.passages[k + 1].before, hits[k + 1], landing.passages[: k + 1]
    assert met is not None
    leave = reduce(and_, (p.found & p.hit & p.goes_on for p in passed), every)
    there = [met.x, met.y, met.z, every & met.hit]
    return [*coming.origin, *coming.direction, passed[-1].leaving, leave, *there]


def _toward_next(path: LightPath, k: int, *rays: Floats) -> tuple[Floats, ...]:
    """Return of rays to the next face the same as `_behind_last`, and z where they meet it, inf beside it.

    rays : as of `_between`, in numpy.

    Raises UserError : there are none.
    """
    start, direction, (flux, leave), met, hit = rays[:3], rays[3:6], rays[6:8], rays[8:11], rays[11]
    there = path.surfaces[k + 1].pose
    mean = [float(np.where(leave, d, 0.0) @ flux) for d in direction]
    if not any(mean):
        raise UserError(DARK)
    frame = Pose.facing(path.surfaces[k].pose.shift, there.directions(np.array(mean)))
    own = frame.inverse() @ there
    x, y, z = own.points(start)
    p, q, r = own.directions(direction)
    onward = leave & (r > 0)
    length = -z / np.where(onward, r, 1)
    end = np.where(hit, own.points(met)[2], inf)
    return z, x + length * p, y + length * q, p, q, onward, end


def _front(lit: Sequence[Floats], emitted: Floats, in_disk: int) -> tuple[float, float]:
    """Return the mean irradiance of what is lit of the front, W/mm^2, and the least disk that tells it, mm.

    lit : as of `_on_front`, (4 or 1, n).  in_disk : cells or rays that tell the irradiance.

    Raises UserError : none is lit.
    """
    u, v, onto = lit
    meets = onto.all(axis=0) & (emitted > 0)
    if (count := np.count_nonzero(meets)) < LEAST_RAYS:
        raise UserError(DARK)
    area = ConvexHull(np.stack([u[:, meets], v[:, meets]], axis=-1).reshape(-1, 2), qhull_options="QJ").volume
    return float(emitted[meets].sum()) / area, 2 * sqrt(in_disk * area / count / pi)


def _light(path: LightPath, k: int, traced: Sequence[Floats], emitted: Floats, disk: float) -> StraightLight:
    """Return cells (4, n) or rays (1, n) that leave a face as StraightLight.

    traced : z, x, y, p, q, which go this way, and the end, as of `_toward_next`.

    Raises UserError : there are none.
    """
    height, x, y, p, q, out, end = traced
    leaves = out.all(axis=0) & (emitted > 0)
    if not leaves.any():
        raise UserError(DARK)
    height, flux, z0 = height[:, leaves], emitted[leaves], float(height[:, leaves].max())
    slope = np.stack([p, q])[:, :, leaves]
    slope /= np.sqrt(1 - (slope**2).sum(axis=0))
    start = np.stack([x, y])[:, :, leaves] + z0 * slope
    begin, end = height.mean(axis=0), end[:, leaves].mean(axis=0)
    throw = path.throw_of(k) if k == len(path.surfaces) - 1 else np.max(end, where=end < inf, initial=z0)
    # behind the rear of the first lens light has not come together before all of it has left
    nearest = z0 if k == 1 and path.surfaces[k].kind == "refract" else float(begin.min())
    return StraightLight(
        face=k,
        start=start,
        slope=slope,
        middle=(start.mean(axis=1), slope.mean(axis=1)),
        flux=flux,
        begin=begin,
        end=end,
        z0=z0,
        depth=float(np.average(begin, weights=flux)),
        nearest=nearest,
        farthest=max(z0, FAR if isinf(throw) else float(throw)),
        disk=disk,
    )


def _parts(traced: Floats, cells: SourceCells | None, step: int) -> Floats:
    """Return what is known of rays, (1, n), or for the four corners of every cell, (4, n).

    step : of merged cells.
    """
    if cells is None:
        return traced[None, :]
    at = traced.reshape(len(cells.s), len(cells.t))[::step, ::step]
    return np.stack([at[i : i - 1 or None, j : j - 1 or None].ravel() for i in (0, 1) for j in (0, 1)])


def _merged(emitted: Floats, step: int) -> Floats:
    """Return the flux of cells of which step^2 are merged, (n,)."""
    nx, ny = (n // step for n in emitted.shape)
    return emitted.reshape(nx, step, ny, step).sum(axis=(1, 3)).ravel()
