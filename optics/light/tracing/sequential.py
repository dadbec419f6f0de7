"""Sequential tracing: rays from a source over the surfaces of a light path to its receiver.

What no change of coefficients reaches is traced once: the surfaces before the first that carries a sag.
Light along z that comes through a plane is still parallel, so that its meeting points with the next surface
are known; all others are searched for.  Every ray ends in exactly one of the fates that `SequentialFates`
names.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cache, reduce
from itertools import pairwise, takewhile
from operator import and_
from typing import TypeAlias

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import (
    DeviceRays,
    Hits,
    KnownHits,
    SearchedHits,
    Vector,
    device_flux,
    on_device,
)
from optics.light.tracing.fates import OFF_TARGET, ON_TARGET, Fate, SequentialFates, by_name
from optics.light.tracing.landings import Landing
from optics.light.tracing.obstructions import Obstruction, ShadingBody
from optics.light.tracing.refraction import polarising
from optics.light.tracing.traced_surface import (
    Passage,
    TracedSurface,
    knots_of,
    parted,
    stays_parallel,
    through_plane,
)
from optics.scene.paths import AIR, LightPath
from optics.scene.sources import RayGrid, Rays
from thbcad.checks import Floats
from thbcad.poses import IDENTITY
from thbcad.splines import KnotVector

Coefficients: TypeAlias = "Sequence[Floats]"
COUNTED = ("missed", "unresolved", "total_internal", "blocked")  # fates of rays at a surface
Step: TypeAlias = "tuple[Hits | None, Passage]"  # no Hits where light along z passes a plane


class Tracer:
    """Rays of one source along a path over surfaces whose sags may change.

    Coefficients are those of the sags, (dim,) each, in the order of the path; None are the path's own.

    proven : the first of several meetings with a rough surface is proven, else the ray is undecided, see
        `SearchedHits`.  This costs up to three times the time.
    polarised : light is polarised by the faces on its way; else every face sends on the mean of s and p.
    """

    def __init__(
        self,
        backend: Backend,
        path: LightPath,
        rays: RayGrid | Rays,
        proven: bool = True,
        polarised: bool = True,
    ) -> None:
        self._backend, self._path, self._proven, self._polarised = backend, path, proven, polarised
        self._embeddings = [sag.space.embedding for sag in path.sags]
        self._frames = [surface.pose for surface in path.surfaces] or [IDENTITY]
        self._ahead = [b.inverse() @ a for a, b in pairwise(self._frames)]  # from a surface to the next
        self._receiver = path.receiver.seen_from(self._frames[-1])
        self._number = cache(backend.opaque)
        grid = rays if isinstance(rays, RayGrid) and stays_parallel(path) else None
        self._surfaces = [self._traced(k, grid if k == 1 else None) for k in range(len(path.surfaces))]
        self._begin(rays, grid)
        if not proven and any(isinstance(hits, SearchedHits) for hits in self._changing):
            self.landed()  # an optimiser's searches begin where light meets the path's own sags

    def with_rays(self, rays: Rays) -> Tracer:
        """Return the tracer of other rays along its path.  Its own are given one by one, too."""
        other = copy(self)
        other._begin(rays, None)
        return other

    def _begin(self, rays: RayGrid | Rays, grid: RayGrid | None) -> None:
        """Take rays, and trace them over the surfaces that no coefficients change.

        grid : rays along z that are known to meet the second surface.
        """
        backend, path = self._backend, self._path
        self._emitted = path.share * rays.total
        self._missed = path.share * rays.missed if isinstance(rays, RayGrid) else 0.0
        self._width = rays.flux.size
        self._flux = device_flux(backend, rays.flux if path.share == 1 else path.share * rays.flux)
        starts = path.before if isinstance(rays, RayGrid) else rays.origin[2].max()
        self._obstructions = self._in_the_way(max(0.0, path.emitted - starts))
        self._polarised_behind = polarising(path, rays) if self._polarised else range(0)
        self._fixed: list[Step] = []  # over surfaces that no coefficients change
        if grid is not None:
            # meeting points with the second surface are known, and the grid lies within the plane's rectangle
            second, direction = self._surfaces[1].hits, (0.0, 0.0, 1.0)
            assert isinstance(second, KnownHits)
            _, share, _ = self._surfaces[0].turned(direction, (backend.Float(0), backend.Float(0)))
            hit, blocked = through_plane(backend, self._surfaces[0], grid, path.before, self._obstructions[0])
            before = DeviceRays((second.x, second.y, 0.0), direction, self._flux)
            entering = backend.dr.select(hit, self._flux * share, 0)
            origin = second.x, second.y, self._ahead[0].shift[2].item()
            self._fixed = [(None, Passage(before, True, hit, True, self._flux, entering, blocked))]
            self._behind = DeviceRays(origin, direction, entering)
            return
        single = rays.rays(path.before)
        self._source = self._behind = on_device(backend, single.posed(self._frames[0].inverse()), self._flux)
        for k, _ in enumerate(takewhile(lambda s: s.shape.sag is None, path.surfaces[:-1])):
            step, self._behind = self._over(k, self._behind, None)
            self._fixed.append(step)
            behind = self._behind
            backend.dr.eval(behind.origin, behind.direction, behind.flux, behind.stokes)

    def trace(self, coefficients: Coefficients | None = None) -> tuple[list[Hits], Landing]:
        """Return (Hits of every surface that carries a sag, Landing), differentiable in the hits' leaves."""
        every, landing = self.trace_all(coefficients)
        pairs = zip(every, self._path.surfaces)
        return [hits for hits, s in pairs if hits is not None and s.shape.sag is not None], landing

    def landed(self) -> Landing:
        """Return the Landing of the path's own sags, without derivatives."""
        with self._backend.dr.suspend_grad():
            return self.trace()[1]

    def trace_all(self, coefficients: Coefficients | None = None) -> tuple[list[Hits | None], Landing]:
        """Return (Hits of every surface, Landing).

        There are no Hits of a plane through which light along z goes on to known meeting points.
        """
        steps, rays = self._follow(coefficients, len(self._surfaces))
        passages, dr = [passage for _, passage in steps], self._backend.dr
        goes_on = reduce(and_, (p.goes_on for p in passages[-1:]), True)
        x, y, z = rays.direction
        # where nothing goes on no denominator may vanish
        landed = self._receiver.land(rays.origin, (x, y, dr.select(goes_on, z, 1)), dr, self._number)
        known = reduce(and_, (p.goes_on & p.found for p in passages), landed.met)
        # a ray that never meets the receiver goes on to infinity, unless a body blocks it
        end = dr.inf if self._receiver.far_field else dr.select(landed.met, landed.length, dr.inf)
        blocked, again = self._obstructions[-1].takes(rays, goes_on, end)
        arrives = landed.met if blocked is False else landed.met & ~blocked
        flux = dr.select(arrives, rays.flux, 0)
        return [hits for hits, _ in steps], Landing(
            landed.u, landed.v, landed.p, landed.q, flux, known, passages, blocked, again
        )

    def at(self, surface: int, coefficients: Coefficients | None = None) -> tuple[Hits, Vector, DrArray]:
        """Return (Hits of a surface, directions before it, flux that reaches it, zero for rays that miss).

        surface : its number along the path; directions are in its frame.

        Raises ValueError : light along z passes it without being traced; give rays one by one.
        """
        if surface < len(self._fixed):
            if self._fixed[surface][0] is None:
                raise ValueError("parallel light is not traced to a plane; give rays one by one")
            rays = self._source
            for k in range(surface):
                _, rays = self._over(k, rays, None)
        else:
            _, rays = self._follow(coefficients, surface)
        met = self._surfaces[surface]
        hits = met.meet(rays, self._nets(coefficients)[surface])
        hit, _, _ = self._kept(surface, rays, hits)
        return hits, rays.direction, self._backend.dr.select(hit, met.reaching(rays, hits), 0)

    def _follow(self, coefficients: Coefficients | None, stop: int) -> tuple[list[Step], DeviceRays]:
        """Return the steps over the surfaces before number `stop`, and the rays behind them."""
        nets, steps, rays = self._nets(coefficients), list(self._fixed), self._behind
        for k in range(len(steps), stop):
            step, rays = self._over(k, rays, nets[k])
            steps.append(step)
        return steps, rays

    def _over(self, k: int, rays: DeviceRays, net: Floats | None) -> tuple[Step, DeviceRays]:
        """Return the step over a surface, and the rays behind it in the frame of the next one."""
        surface, leaves = self._surfaces[k], deque[DrArray]()
        if k > 1:
            rays = parted(self._backend, rays, leaves)
        hits = surface.meet(rays, net)
        leaves.extend(hits.leaves)
        hit, blocked, again = self._kept(k, rays, hits)
        passage, direction, stokes = surface.passed(rays, hits, hit, blocked, k in self._polarised_behind)
        passage = replace(passage, again=again)
        point: Vector = (hits.x, hits.y, hits.z)
        for ahead in self._ahead[k : k + 1]:
            point, direction = ahead.points(point), ahead.directions(direction)
            if stokes is not None:
                stokes = replace(stokes, across=ahead.directions(stokes.across))
        if 0 < k < len(self._surfaces) - 1:  # else every surface behind would turn the rays here again
            self._backend.dr.eval(point, direction, passage.leaving, stokes)
        return (hits, passage), DeviceRays(point, direction, passage.leaving, stokes=stokes)

    def _kept(self, k: int, rays: DeviceRays, hits: Hits) -> tuple[DrArray, DrArray | bool, DrArray | bool]:
        """Return the masks of rays that come through to a surface, of those that are blocked, and of those
        among them that meet the surface before again."""
        if self._path.bodies:
            self._backend.dr.eval(*vars(hits).values())  # else whether one is met would search for it again
        taken, again = self._obstructions[k].takes(rays, hits.hit, (hits.x, hits.y, hits.z))
        return *self._surfaces[k].kept(hits.hit, taken, hits.x, hits.y), again

    def _nets(self, coefficients: Coefficients | None) -> list[Floats | None]:
        """Return the nets of the sags on the tensor-product meshes that are traced, None without a sag."""
        sags = [surface.shape.sag for surface in self._path.surfaces]
        if coefficients is None:
            return [None if sag is None else sag.to_bspline().coefficients for sag in sags]
        nets = iter([e.coefficients(c) for e, c in zip(self._embeddings, coefficients)])
        return [None if sag is None else next(nets) for sag in sags]

    def pull_back(
        self, hits: Sequence[Hits], knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[Floats]:
        """Return the derivative by each sag's coefficients after `dr.backward`; the leaves then carry none.

        knots : of each sag, two knot vectors; the derivative is then that by a net over these knots.
        """
        # of all surfaces together: they have most of the path in common
        self._backend.dr.eval([leaf.grad for h in hits for leaf in h.leaves])
        if knots is not None:
            return [s.pull_back(h, k) for s, h, k in zip(self._changing, hits, knots)]
        return [e.adjoint(s.pull_back(h)) for e, s, h in zip(self._embeddings, self._changing, hits)]

    def set_directions(self, hits: Sequence[Hits], directions: Sequence[Floats]) -> list[DrArray]:
        """Set the derivatives of all leaves to those along a direction in the coefficients; return them."""
        nets = [e.coefficients(d) for e, d in zip(self._embeddings, directions)]
        for surface, hit, net in zip(self._changing, hits, nets):
            for leaf, slope in zip(hit.leaves, surface.jet(hit, net)):
                self._backend.dr.set_grad(leaf, slope)
        return [leaf for hit in hits for leaf in hit.leaves]

    @property
    def _changing(self) -> list[KnownHits | SearchedHits]:
        """What meets the surfaces that carry a sag."""
        return [s.hits for s in self._surfaces if s.surface.shape.sag is not None]

    def fates(
        self, landing: Landing, half_width: tuple[float, float], weights: DrArray | None = None
    ) -> SequentialFates:
        """Return the flux of a traced landing by fate, for a target rectangle.

        Light that does not meet the receiver is beside the target.

        weights : of the rays, by which the flux that each carries is multiplied.
        """
        dr = self._backend.dr
        onto = (dr.abs(landing.x) <= half_width[0]) & (dr.abs(landing.y) <= half_width[1])

        def total(values: DrArray, mask: DrArray | bool) -> float:
            if mask is False:
                return 0.0
            every = dr.select(mask, values, 0) + dr.zeros(self._backend.Float, self._width)
            every = every if weights is None else every * weights
            return float(dr.sum(every).numpy()[0])

        before, emitted = self._flux, self._emitted if weights is None else total(self._flux, True)
        coming = self._missed + emitted
        lost: dict[Fate, float] = defaultdict(float)
        for k, (surface, p) in enumerate(zip(self._path.surfaces, landing.passages)):
            blocked, hit, again = (total(before, mask) for mask in (p.blocked, p.hit, p.again))
            unresolved = total(before, dr.select(p.found | p.blocked, False, True))
            absorbing = self._path.media[k].absorption
            reaching = total(p.reaching, p.hit) if absorbing else hit
            going = reaching if k == 0 else total(p.reaching, p.hit & p.goes_on)
            leaving = total(p.leaving, True)
            kept = "absorbed" if surface.kind == "reflect" else "reflected"  # by a metal, or behind it
            for what, flux in (
                ("missed", coming - unresolved - blocked - hit),
                ("unresolved", unresolved),
                ("blocked", blocked - again),
                ("absorbed", hit - reaching),
                ("total_internal", reaching - going),
                (kept, going - leaving),
            ):
                lost[Fate.at(what, k, surface.name)] += flux
            lost[self._met_again(k)] += again
            coming, before = leaving, p.leaving
        on_target, again = total(landing.flux, onto), total(before, landing.again)
        blocked = total(before, landing.blocked)
        lost[Fate("blocked")] += blocked - again
        lost[self._met_again(len(landing.passages))] += again
        lost |= {ON_TARGET: on_target, OFF_TARGET: coming - blocked - on_target}
        return SequentialFates({fate: max(0.0, flux) for fate, flux in lost.items()})  # none is negative

    def _met_again(self, way: int) -> Fate:
        """Return the fate of light that meets the face again where its way, by number, begins."""
        name = self._path.surfaces[way - 1].name if way else ""
        return Fate("hit_twice", way - 1, name) if name else Fate("blocked")

    def counts(self, landing: Landing, half_width: tuple[float, float]) -> dict[str, int]:
        """Return how many rays have each fate.

        Reflected light is not counted: it splits off rays that go on.
        """
        dr = self._backend.dr
        onto = (dr.abs(landing.x) <= half_width[0]) & (dr.abs(landing.y) <= half_width[1])
        alive = dr.ones(dr.mask_t(self._backend.Float), self._width)
        names = [surface.name for surface in self._path.surfaces]
        counts = {Fate.at(what, k, name): 0 for what in COUNTED for k, name in enumerate(names)}

        def count(mask: DrArray) -> int:
            return int(dr.count(mask).numpy()[0])

        for k, (name, p) in enumerate(zip(names, landing.passages)):
            free = dr.select(p.blocked, False, alive)
            found = free & p.found
            hit = found & p.hit
            passing = hit & p.goes_on
            again = count(alive & p.again)
            ends = found & ~hit, free & ~found, hit & ~passing, alive & p.blocked
            for what, mask in zip(COUNTED, ends):
                counts[Fate.at(what, k, name)] += count(mask) - again * (what == "blocked")
            counts[self._met_again(k)] = counts.get(self._met_again(k), 0) + again
            alive = passing
        again, last = count(alive & landing.again), self._met_again(len(landing.passages))
        counts[Fate("blocked")] = counts.get(Fate("blocked"), 0) + count(alive & landing.blocked) - again
        counts[last] = counts.get(last, 0) + again
        alive = dr.select(landing.blocked, False, alive)
        counts |= {ON_TARGET: count(alive & onto), OFF_TARGET: count(alive & ~onto)}
        return by_name(counts)

    def _in_the_way(self, early: float) -> list[Obstruction]:
        """Return what is in the way to every surface and to the receiver.

        The rays are in the frame of the next or of the last surface.

        early : mm, of the way that lies before the source.
        """
        path, backend, frames = self._path, self._backend, self._frames
        bodies, ways = [ShadingBody(backend, body) for body in path.bodies], []
        for k, (medium, frame) in enumerate(zip(path.media, [*frames[: len(path.surfaces)], frames[-1]])):
            back, air = frame.inverse(), medium == AIR
            stops = [stop.moved(back) for stop in path.stops if air]
            placed = [
                (b, back @ b.body.pose_between(k - 1, k), not {k - 1, k}.isdisjoint(b.body.faces))
                for b in bodies
                if air
            ]
            ways.append(Obstruction(backend, stops, placed, 0.0 if k else early, k - 1))
        return ways

    def _traced(self, k: int, grid: RayGrid | None) -> TracedSurface:
        """Return a surface of the path.  grid : of light along z, which meets it behind a plane."""
        path, backend = self._path, self._backend
        surface, hits = path.surfaces[k], None
        shape, knots = surface.shape, knots_of(surface.shape)
        changes = any(s.shape.sag is not None for s in path.surfaces[: k + 1])
        if grid is not None and knots is not None:
            hits = KnownHits(backend, grid, shape.conic, shape.outline, knots)
        return TracedSurface(
            backend,
            surface,
            (path.media[k], path.media[k + 1]),
            hits or SearchedHits(backend, shape.conic, shape.outline, knots, self._proven),
            path.soft_rim if changes else 0.0,
        )
