"""Non-sequential tracing: every ray through the closed lens, with every split at its faces.

At each face a branch splits into a refracted and a reflected one, by Fresnel's equations for the light as it
is polarised. Branches go on, generation by generation, until they leave the lens for good, fall below a
threshold or have met too many faces. Every part of the source flux ends in one named fate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend
from optics.light.tracing.branches import (
    EDGE,
    FRONT,
    LEFT,
    NEVER,
    OUTSIDE,
    REAR,
    UNDECIDED,
    BranchAccount,
    Branches,
    ClosedLens,
    Meetings,
    indirectly_onto_rear,
    split,
)
from optics.light.tracing.fates import FATES, Fates
from optics.light.tracing.landings import LandingPoints
from optics.scene.paths import BARE, Coats, LightPath, Stop
from optics.scene.receivers import Receiver
from optics.scene.sources import Rays, require_rays
from thbcad.checks import Floats
from thbcad.moulds import Made, Solid
from thbcad.outlines import Outline

BOUNCES = 64  # the most faces that a branch meets
FEW = 7  # faces, after which few branches are left


@dataclass(frozen=True)
class TargetArea:
    """The rectangle |u| <= half_width[0], |v| <= half_width[1] of a receiver, and what takes light before it.

    receiver, stops : in the lens's frame.  clear : what a holder leaves free of front and rear; None is all.
    absorbing_wall : light that meets an edge of the lens ends there; else edges are polished.
    absorption : a, 1/mm: exp(-a t) of the light is left after the path t in the lens.
    coats : as of `ClosedLens`.
    """

    receiver: Receiver
    half_width: tuple[float, float]
    stops: tuple[Stop, ...] = ()
    clear: tuple[Outline | None, ...] = ()
    absorbing_wall: bool = False
    absorption: float = 0.0
    coats: Coats = BARE

    @classmethod
    def of(cls, path: LightPath, half_width: tuple[float, float]) -> TargetArea:
        """Return the rectangle on the receiver of a path through front and rear."""
        front, rear = path.surfaces
        return cls(
            path.receiver,
            half_width,
            path.stops,
            (front.clear, rear.clear),
            path.absorbing_wall,
            path.media[1].absorption,
            (front.share, rear.share),
        )

    @property
    def blocks(self) -> bool:
        """Whether anything blocks light."""
        return bool(self.stops) or any(self.clear) or self.absorbing_wall


@dataclass(frozen=True, eq=False)
class Departures:
    """Branches that left the lens by any of its faces, in all directions.

    direction : (3, k), unit vectors.  flux : (k,), W.
    """

    direction: Floats
    flux: Floats


@dataclass(frozen=True, eq=False)
class NonsequentialResult:
    """Where the light went.

    by_ray : (len(FATES), n), W, of every source ray by fate.
    landings : of the m branches that cross the target plane, on the rectangle or beside it.
    ray : (m,), index of the source ray.  fate : (m,), index into FATES.
    direct : (m,), True for the path front, rear, target, with two refractions and nothing else.
    departures : of the branches that left the lens, be it forward or back.
    onto_rear : branches on their way within to a rear that lets some of them through, by no direct path.
    """

    by_ray: Floats
    landings: LandingPoints
    ray: NDArray[np.int64]
    fate: NDArray[np.int64]
    direct: NDArray[np.bool_]
    departures: Departures
    onto_rear: Branches

    @property
    def fates(self) -> Fates:
        return Fates(*(float(f) for f in self.by_ray.sum(axis=1)))


def trace_nonsequential(
    backend: Backend,
    lens: Made,
    rays: Rays,
    target: TargetArea,
    bounces: int = BOUNCES,
    threshold: float = 1e-4,
    roulette: np.random.Generator | None = None,
) -> NonsequentialResult:
    """Trace rays through the closed lens with all reflections.

    lens : or its body for a mould, or a plate of lenses.  bounces : the most faces that a branch meets.
    threshold : of a branch's flux, relative to its source ray.  Both drop branches as `trapped`.
    roulette : decides on branches below the threshold instead.  They survive with the probability
        flux / (threshold * flux of the ray) and then carry that threshold, so that fluxes hold on average.
        Past FEW faces the threshold doubles at each, up to 1: the last branches are soon gone.
    """
    require_rays(rays)
    solid = ClosedLens(backend, lens, target.coats)
    account, landings, departures = BranchAccount(len(rays.flux), target.absorption), [], []
    branches, onto_rear = Branches.start(rays), Branches.start(rays)[np.arange(0)]
    for generation in range(bounces + 1):
        meetings = solid.meet(branches)
        if target.blocks or solid.absorbs:
            length = _blocked_after(branches, meetings, target)
            blocked = np.isfinite(length)
            account.add(account.dimmed(branches[blocked], length[blocked]), FATES.index("blocked"))
            branches, meetings = branches[~blocked], meetings[~blocked]
        leaving = np.isin(meetings.face, (NEVER, UNDECIDED))
        gone, undecided = branches[leaving], meetings.face[leaving] == UNDECIDED
        fate, x, y, reaches = _fates(gone, undecided, target)
        account.add(gone, fate)
        left = (gone.left >= FRONT) & (fate != FATES.index("failed"))
        departures.append((gone.direction[:, left], gone.flux[left]))
        gone = gone[reaches]
        landings.append((x[reaches], y[reaches], gone.flux, gone.ray, fate[reaches], gone.stage == LEFT))
        if generation == bounces:
            account.add(branches[~leaving], FATES.index("trapped"))
            break
        branches, meetings = branches[~leaving], meetings[~leaving]
        onto_rear += indirectly_onto_rear(branches, meetings)
        branches = account.dimmed(branches, np.linalg.norm(meetings.point - branches.origin, axis=0))
        refracted, reflected = split(branches, meetings)
        branches = refracted[meetings.transmittance > 0] + reflected
        if roulette is None:
            weak = branches.flux <= threshold * rays.flux[branches.ray]
            account.add(branches[weak], FATES.index("trapped"))
            branches = branches[~weak]
        else:
            later = min(threshold * 2.0 ** max(0, generation + 1 - FEW), max(threshold, 1.0))
            branches = branches.survivors(later * rays.flux[branches.ray], roulette)
        if not len(branches.ray):
            break
    x, y, flux, ray, fate, direct = (np.concatenate(column) for column in zip(*landings))
    out = Departures(*(np.concatenate(column, axis=-1) for column in zip(*departures)))
    at = LandingPoints(np.column_stack([x, y]), flux)
    return NonsequentialResult(account.by_ray, at, ray, fate, direct, out, onto_rear)


def seen_branches(
    backend: Backend, lens: Made, rays: Rays, bounces: int = 6, black_wall: bool = False, coats: Coats = BARE
) -> Branches:
    """Return what a camera sees along rays that come to the closed lens: branches that leave it.

    These are the part that the outside of the lens reflects, and the stronger part at every later face.  Rays
    that pass the lens by are among them.  What met `bounces` faces more and is still inside is dropped, and
    so is what meets a black wall.  coats : as of `ClosedLens`.
    """
    require_rays(rays)
    solid, branches, gone = ClosedLens(backend, lens, coats), Branches.start(rays), []
    for generation in range(bounces + 1):
        meetings = solid.meet(branches)
        leaving = np.isin(meetings.face, (NEVER, UNDECIDED))
        onward = ~(leaving | meetings.absorbed | (black_wall & (meetings.face == EDGE)))
        refracted, reflected = split(branches, meetings)
        passes = meetings.transmittance >= 0.5 if generation else meetings.transmittance > 0
        gone.append(branches[leaving & ~branches.inside])
        if not generation:
            gone.append(reflected[onward])
        branches = refracted[onward & passes]
        if generation:
            branches = branches + reflected[onward & ~passes]
        if not len(branches.ray):
            break
    return sum(gone[1:], start=gone[0])


@dataclass(frozen=True, eq=False)
class RayPath:
    """The strongest branch of a ray: points (k, 3), mm, from the source to the fate, a name out of FATES."""

    points: Floats
    fate: str


def trace_paths(backend: Backend, lens: Solid, rays: Rays, target: TargetArea) -> list[RayPath]:
    """Return the path of the stronger part at every face, for drawing.

    A path ends on the target; one to the far field, and others, a lens's thickness after the last face, or
    on the last of BOUNCES faces.
    """
    require_rays(rays)
    solid, branches = ClosedLens(backend, lens), Branches.start(rays)
    points = [[point] for point in rays.origin.T]
    fates = ["trapped"] * len(points)
    for generation in range(BOUNCES + 1):
        meetings = solid.meet(branches)
        length = _blocked_after(branches, meetings, target)
        for k in np.flatnonzero(np.isfinite(length)):
            ray = branches.ray[k]
            points[ray].append(branches.origin[:, k] + length[k] * branches.direction[:, k])
            fates[ray] = "blocked"
        branches, meetings = branches[np.isinf(length)], meetings[np.isinf(length)]
        leaving = np.isin(meetings.face, (NEVER, UNDECIDED))
        gone, undecided = branches[leaving], meetings.face[leaving] == UNDECIDED
        fate, x, y, reaches = _fates(gone, undecided, target)
        stub = (gone.origin + lens.thickness * gone.direction).T
        there = np.stack(np.broadcast_arrays(*target.receiver.points(x, y)), axis=-1)
        ends = np.where((reaches & (not target.receiver.far_field))[:, None], there, stub)
        for ray, end, which in zip(gone.ray, ends, fate):
            points[ray].append(end)
            fates[ray] = FATES[which]
        for ray, point in zip(branches.ray[~leaving], meetings.point.T[~leaving]):
            points[ray].append(point)
        refracted, reflected = split(branches, meetings)
        passes = meetings.transmittance >= 0.5
        branches = refracted[~leaving & passes] + reflected[~leaving & ~passes]
        if generation == BOUNCES or not len(branches.ray):
            break
    return [RayPath(np.array(row), fate) for row, fate in zip(points, fates)]


def _blocked_after(branches: Branches, meetings: Meetings, target: TargetArea) -> Floats:
    """Return the path lengths after which branches meet a stop, a holder or a black wall; inf of others."""
    ahead = np.linalg.norm(meetings.point - branches.origin, axis=0)
    first = np.where(meetings.absorbed, ahead, np.inf)
    if target.absorbing_wall:
        first = np.where(meetings.face == EDGE, ahead, first)
    for face, clear in zip((FRONT, REAR), target.clear):
        if clear is not None:
            x, y, _ = meetings.point
            beside = (meetings.face == face) & ~clear.contains(x, y)
            first = np.where(beside, ahead, first)
    if target.stops:
        landed = target.receiver.land(branches.origin, branches.direction)
        ends = landed.met & (landed.length >= 0) & (not target.receiver.far_field)
        reach = np.where(meetings.face == NEVER, np.where(ends, landed.length, np.inf), ahead)
        reach = np.where(branches.inside | (meetings.face == UNDECIDED), 0.0, reach)
        for stop in target.stops:
            length = stop.distance(branches.origin, branches.direction)
            first = np.where(length < reach, np.minimum(first, length), first)
    return first


def _fates(
    gone: Branches, undecided: NDArray[np.bool_], target: TargetArea
) -> tuple[NDArray[np.int64], Floats, Floats, NDArray[np.bool_]]:
    """Return (fates, x, y, crossing) of branches that meet no face, or none that is proven.

    x, y : mm, in the target plane.  crossing : the mask of those that cross it.
    """
    failed = gone.inside | undecided
    landed = target.receiver.land(gone.origin, gone.direction)
    x, y, reaches = landed.u, landed.v, landed.met & (landed.length >= 0) & ~failed
    onto = (abs(x) <= target.half_width[0]) & (abs(y) <= target.half_width[1])
    on, off = (
        np.array([FATES.index(name + side) for name in ("front_", "", "edges_", "neighbours_")])
        for side in ("on_target", "off_target")
    )
    exit_face = np.maximum(gone.left, FRONT) - FRONT
    # beside the target goes what passes a curved one, and what sequential tracers count so: all direct light
    ahead = target.receiver.pose.rotation[:, 2] @ gone.direction > 0
    misses = ~landed.met & ahead | (gone.stage == LEFT) & ~reaches
    fate = np.where(misses, off[exit_face], FATES.index("back"))
    fate = np.where(reaches, np.where(onto, on[exit_face], off[exit_face]), fate)
    fate = np.where(gone.left == NEVER, FATES.index("beside_lens"), fate)
    fate = np.where(gone.left == OUTSIDE, FATES.index("reflected_outside"), fate)
    return np.where(failed, FATES.index("failed"), fate), x, y, reaches
