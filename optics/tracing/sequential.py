"""Sequential tracing: source, front, rear, target.

A front surface that carries no sag is treated once.  Behind a plane one at normal incidence the
rays are still parallel to z, so that their meeting points with the rear are known; otherwise
they are searched for.  Every ray ends in exactly one of the fates that `SequentialFates` names.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from optics.sources import RayGrid, Rays, single_rays
from optics.tracing.fates import SequentialFates
from optics.tracing.intersections import (
    DeviceRays,
    Hits,
    KnownHits,
    device_flux,
    on_device,
    raised_hits,
    rim_fade,
)
from optics.tracing.landings import Landing
from optics.tracing.refraction import refract
from optics.tracing.searched_intersections import SearchedHits
from thbcad.poses import Pose

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray
    from optics.tracing.intersections import Vector
    from optics.tracing.light_path import LightPath
    from thbcad.lens import FreeformSurface
    from thbcad.splines import KnotVector

Coefficients: TypeAlias = "Sequence[NDArray[np.float64]]"

RAISING_STEPS = 6  # at most: an error of 1 um with slopes of 1e-3 takes one, a gross one of 0.01 mm three


class Tracer:
    """Rays of one source along a path through a lens whose sags may change.

    sure : the first of several meetings with a rough surface is proven, else the ray is undecided, see
        `SearchedHits`.  This costs up to three times the time.
    """

    def __init__(self, backend: Backend, path: LightPath, rays: RayGrid | Rays, sure: bool = True) -> None:
        lens, errors = path.lens, path.slope_errors
        self._backend, self._path, self._lens = backend, path, lens
        dr, Float = backend.dr, backend.Float
        self._emitted = rays.total
        self._missed = rays.missed if isinstance(rays, RayGrid) else 0.0
        self._width = rays.flux.size
        # opaque numbers do not become part of the kernels, which then serve every source and lens
        self._index, self._inverse = dr.opaque(Float, lens.index), dr.opaque(Float, 1 / lens.index)
        self._receiver = path.receiver.seen_from(Pose.at((0.0, 0.0, lens.thickness)))  # the rear's vertex
        self._number = cache(partial(dr.opaque, Float))
        self._absorption = dr.opaque(Float, path.absorption) if path.absorption else None
        self._flux = device_flux(backend, rays.flux)
        self._embeddings = [s.sag.space.embedding for s in (lens.front, lens.rear) if s.sag is not None]
        self._rear: KnownHits | SearchedHits
        self._behind: tuple[Hits | None, DeviceRays] | None = None  # of a front that never changes
        knots = _knots(lens.rear)
        self._errors = [e if e is None else [*map(backend.array, e)] for e in (errors.front, errors.rear)]
        plane = lens.front.is_plane and errors.front is None and path.height_errors[0] is None
        if isinstance(rays, RayGrid) and plane and path.front.is_identity and knots is not None:
            self._rear = KnownHits(backend, rays, lens.rear.conic, lens.rear.half_width, knots)
            self._behind = None, self._parallel(self._rear)
            return
        self._source = on_device(backend, single_rays(rays, lens), self._flux)
        self._front = SearchedHits(backend, lens.front.conic, lens.front.half_width, _knots(lens.front), sure)
        self._rear = SearchedHits(backend, lens.rear.conic, lens.rear.half_width, knots, sure)
        if lens.front.sag is None:
            self._behind = self._through_front(None)
            behind = self._behind[1]
            dr.eval(behind.origin, behind.direction, behind.flux)

    def trace(self, coefficients: Coefficients | None = None) -> tuple[list[Hits], Landing]:
        """Return (Hits of every surface that carries a sag, Landing), differentiable in the hits' leaves.

        coefficients : of the sags, (dim,) each, front first; None are those of the lens.
        """
        front, rear, landing = self.trace_all(coefficients)
        surfaces = (front, self._lens.front), (rear, self._lens.rear)
        changing = [hits for hits, surface in surfaces if hits is not None and surface.sag is not None]
        return changing, landing

    def trace_all(self, coefficients: Coefficients | None = None) -> tuple[Hits | None, Hits, Landing]:
        """Return (Hits of the front, None where parallel light passes a plane, Hits of the rear, Landing)."""
        front, behind, rear = self._meet(coefficients)
        return front, rear, self._landing(front, behind, rear)

    def at_front(self, coefficients: Coefficients | None = None) -> tuple[Hits, Vector, DrArray]:
        """Return (Hits of a free front, directions before it, flux before it, zero for rays that miss)."""
        net, rays = self._nets(coefficients)[0], self._source
        hits = self._front.meet(rays.origin, rays.direction, net)
        return hits, rays.direction, self._backend.dr.select(hits.hit, rays.flux, 0)

    def at_rear(self, coefficients: Coefficients | None = None) -> tuple[Hits, Vector, DrArray]:
        """Return (Hits of the rear, directions inside the lens, flux inside the lens).

        The flux is zero for rays that miss.
        """
        _, behind, hits = self._meet(coefficients)
        return hits, behind.direction, self._backend.dr.select(hits.hit, behind.flux, 0)

    def _meet(self, coefficients: Coefficients | None) -> tuple[Hits | None, DeviceRays, Hits]:
        """Return (Hits of the front, None where they are known, the rays behind it, Hits of the rear)."""
        nets = self._nets(coefficients)
        front, behind = self._behind or self._through_front(nets[0])
        net = None if self._lens.rear.sag is None else nets[-1]
        return front, behind, self._met(1, behind, net)

    def _nets(self, coefficients: Coefficients | None) -> list[NDArray[np.float64]]:
        """Return the nets of the sags on the tensor-product meshes that are traced."""
        if coefficients is None:
            coefficients = [sag.coefficients for sag in self._lens.sags]
        return [e.coefficients(c) for e, c in zip(self._embeddings, coefficients)]

    def _met(self, surface: int, rays: DeviceRays, net: NDArray[np.float64] | None) -> Hits:
        """Return the Hits of rays with a surface.  surface : 0 is the front, 1 the rear."""
        hits, error = (self._rear if surface else self._front), self._path.height_errors[surface]

        def meet(height: DrArray | float) -> Hits:
            if isinstance(hits, KnownHits):
                assert net is not None
                return hits.meet(net)
            x, y, z = rays.origin
            return hits.meet((x, y, z - height), rays.direction, net)

        if error is None:
            return meet(0.0)
        return raised_hits(self._backend, error, meet, 0 if isinstance(hits, KnownHits) else RAISING_STEPS)

    def pull_back(
        self, hits: Sequence[Hits], knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[NDArray[np.float64]]:
        """Return the derivative by each sag's coefficients after `dr.backward`; the leaves then carry none.

        knots : of each sag, two knot vectors; the derivative is then that by a net over these knots.
        """
        # of all surfaces together: they have most of the path in common
        self._backend.dr.eval([leaf.grad for h in hits for leaf in h.leaves])
        if knots is not None:
            return [s.pull_back(h, k) for s, h, k in zip(self._changing, hits, knots)]
        return [e.adjoint(s.pull_back(h)) for e, s, h in zip(self._embeddings, self._changing, hits)]

    def set_directions(
        self, hits: Sequence[Hits], directions: Sequence[NDArray[np.float64]]
    ) -> list[DrArray]:
        """Set the derivatives of all leaves to those along a direction in the coefficients; return them."""
        nets = [e.coefficients(d) for e, d in zip(self._embeddings, directions)]
        for surface, hit, net in zip(self._changing, hits, nets):
            for leaf, slope in zip(hit.leaves, surface.jet(hit, net)):
                self._backend.dr.set_grad(leaf, slope)
        return [leaf for hit in hits for leaf in hit.leaves]

    @property
    def _changing(self) -> list[KnownHits | SearchedHits]:
        """The surfaces that carry a sag, front first."""
        front = [] if self._lens.front.sag is None else [self._front]
        rear = [] if self._lens.rear.sag is None else [self._rear]
        return [*front, *rear]

    def fates(self, landing: Landing, half_width: tuple[float, float]) -> SequentialFates:
        """Return the flux of a traced landing by fate, for a target rectangle."""
        dr = self._backend.dr
        onto = (dr.abs(landing.x) <= half_width[0]) & (dr.abs(landing.y) <= half_width[1])

        def total(values: DrArray, mask: DrArray) -> float:
            every = dr.select(mask, values, 0) + dr.zeros(self._backend.Float, self._width)
            return float(dr.sum(every).numpy()[0])

        lost_before = total(self._flux, dr.select(landing.decided, False, True))
        lost_inside = total(landing.entering, dr.select(landing.found, False, True))
        met = total(self._flux, landing.met)
        inside = total(landing.entering, True)
        found = total(landing.entering, landing.found)
        hit = total(landing.entering, landing.hit)
        at_rear = hit if self._absorption is None else total(landing.reaching, landing.hit)
        refracted = total(landing.reaching, landing.hit & landing.refracted)
        arriving = total(landing.flux, True)
        on_target = total(landing.flux, onto)
        differences = {
            "beside_lens": self._missed + self._emitted - lost_before - met,
            "front_reflected": met - inside,
            "missed_rear": found - hit,
            "total_internal": at_rear - refracted,
            "rear_reflected": refracted - arriving,
            "off_target": arriving - on_target,
            "absorbed": hit - at_rear,
        }
        return SequentialFates(
            unresolved=lost_before + lost_inside,
            on_target=on_target,
            **{fate: max(0.0, flux) for fate, flux in differences.items()},  # rounding is no negative light
        )

    def counts(self, landing: Landing, half_width: tuple[float, float]) -> dict[str, int]:
        """Return how many rays have each fate.

        Reflected light is not counted: it splits off rays that go on.
        """
        dr = self._backend.dr
        every = dr.ones(dr.mask_t(self._backend.Float), self._width)
        decided, met, found = (every & mask for mask in (landing.decided, landing.met, landing.found))
        onto = (dr.abs(landing.x) <= half_width[0]) & (dr.abs(landing.y) <= half_width[1])
        at_rear = met & found & landing.hit
        arrives = at_rear & landing.refracted
        masks = {
            "beside_lens": decided & ~met,
            "missed_rear": met & found & ~landing.hit,
            "unresolved": ~decided | (met & ~found),
            "total_internal": at_rear & ~landing.refracted,
            "on_target": arrives & onto,
            "off_target": arrives & ~onto,
        }
        return {name: int(dr.count(mask).numpy()[0]) for name, mask in masks.items()}

    def _parallel(self, rear: KnownHits) -> DeviceRays:
        """Return the rays of a collimated beam behind a plane front, in the frame of the rear's vertex."""
        dr, Float = self._backend.dr, self._backend.Float
        direction = (0.0, 0.0, 1.0)
        _, transmittance, _ = self._refracted(direction, (Float(0), Float(0)), self._inverse)
        entering = self._flux * transmittance
        dr.make_opaque(entering)
        return DeviceRays((rear.x, rear.y, -self._lens.thickness), direction, entering)

    def _through_front(self, net: NDArray[np.float64] | None) -> tuple[Hits, DeviceRays]:
        """Return the front's Hits and the rays behind it, in the frame of the rear's vertex."""
        rays = self._source
        hits = self._met(0, rays, net)
        dr = self._backend.dr
        direction, transmittance, _ = self._refracted(rays.direction, self._slopes(hits, 0), self._inverse)
        passing = rays.flux * transmittance * self._rim(hits, self._lens.front)
        flux = dr.select(hits.hit, passing, 0)
        point: Vector = self._path.front.points((hits.x, hits.y, hits.z))
        direction = self._path.front.directions(direction)
        return hits, DeviceRays((point[0], point[1], point[2] - self._lens.thickness), direction, flux)

    def _landing(self, front: Hits | None, behind: DeviceRays, hits: Hits) -> Landing:
        dr = self._backend.dr
        (dx, dy, dz), transmittance, refracted = self._refracted(
            behind.direction, self._slopes(hits, 1), self._index
        )
        forward = refracted & (dz > 0)
        arrives = hits.hit & forward
        reaching = self._left(behind, hits)
        flux = dr.select(arrives, reaching * transmittance * self._rim(hits, self._lens.rear), 0)
        dz = dr.select(forward, dz, 1)
        landed = self._receiver.land((hits.x, hits.y, hits.z), (dx, dy, dz), dr, self._number)
        return Landing(
            x=landed.u,
            y=landed.v,
            p=landed.p,
            q=landed.q,
            flux=flux,
            entering=behind.flux,
            reaching=reaching,
            decided=True if front is None else front.found,
            met=True if front is None else front.hit,
            found=hits.found,
            hit=hits.hit,
            refracted=forward,
        )

    def _left(self, behind: DeviceRays, hits: Hits) -> DrArray:
        """Return the flux that absorption leaves of rays on their way to the rear, exp(-a t)."""
        if self._absorption is None:
            return behind.flux
        dr = self._backend.dr
        path = (hits.z - behind.origin[2]) / behind.direction[2]
        return behind.flux * dr.exp(-self._absorption * dr.select(hits.hit, path, 0))

    def _slopes(self, hits: Hits, surface: int) -> tuple[DrArray, DrArray]:
        """Return the slopes by which rays are refracted.  surface : 0 is the front, 1 the rear."""
        errors = self._errors[surface]
        return (hits.zx, hits.zy) if errors is None else (hits.zx + errors[0], hits.zy + errors[1])

    def _refracted(
        self, direction: Vector, slope: tuple[DrArray, DrArray], eta: DrArray
    ) -> tuple[Vector, DrArray, DrArray]:
        """Return what `refract` does, all light passing where Fresnel's losses are left out."""
        out, transmittance, passes = refract(self._backend.dr, direction, slope, eta)
        if not self._path.reflection:
            transmittance = self._backend.dr.select(passes, self._backend.Float(1), 0)
        return out, transmittance, passes

    def _rim(self, hits: Hits, surface: FreeformSurface) -> DrArray:
        """Return 1 inside a surface, falling to 0 at its rim, see `rim_fade`."""
        fixed = surface.sag is None and (surface is self._lens.front or self._lens.front.sag is None)
        if not self._path.soft_rim or fixed or isinstance(self._rear, KnownHits):
            return 1.0
        return rim_fade(self._backend, (hits.x, hits.y), surface.half_width, self._path.soft_rim)


def _knots(surface: FreeformSurface) -> tuple[KnotVector, KnotVector] | None:
    """Return the knots in mm of a sag's tensor-product form."""
    if surface.sag is None:
        return None
    embedding = surface.sag.space.embedding
    kv_x, kv_y = (kv.rescaled(-h, h) for kv, h in zip((embedding.kv_u, embedding.kv_v), surface.half_width))
    return kv_x, kv_y
