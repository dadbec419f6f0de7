"""Sequential tracing: source, front, rear, target.

A front surface that carries no sag is treated once.  Behind a plane one at normal incidence the
rays are still parallel to z, so that their meeting points with the rear are known; otherwise
they are searched for.  Every ray ends in exactly one of the fates that `FluxBudget` names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isinf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.sources import Beam, Rays, beam_rays
from optics.tracing.intersections import Hits, KnownHits, SearchedHits
from optics.tracing.refraction import refract

if TYPE_CHECKING:
    from optics.runtime import Backend, DrArray
    from thbcad.lens import FreeformSurface, Lens
    from thbcad.splines import KnotVector

    Vector = tuple[DrArray, DrArray, DrArray]


@dataclass(eq=False)
class Landing:
    """Where rays meet the target: x, y in mm (degrees in the far field), flux in W (zero unless they arrive).

    p, q : direction cosines along x and y behind the lens.
    entering : flux behind the front.  decided, met : of the front, as `found` and `hit` of Hits.
    found, hit : of the rear, as in Hits.
    refracted : the ray leaves the rear surface forward.
    """

    x: DrArray
    y: DrArray
    p: DrArray
    q: DrArray
    flux: DrArray
    entering: DrArray
    decided: DrArray
    met: DrArray
    found: DrArray
    hit: DrArray
    refracted: DrArray


@dataclass(frozen=True, eq=False)
class _Bundle:
    """Rays behind the front: origin from the rear vertex (None: known), direction, flux; masks as in
    `Landing`."""

    origin: Vector | None
    direction: Vector
    flux: DrArray
    decided: DrArray | bool
    met: DrArray | bool


@dataclass(frozen=True)
class FluxBudget:
    """The source flux by fate, in W; the fates sum to the source flux.

    beside_lens : passes beside the front.  front_reflected, rear_reflected : Fresnel losses.
    missed_rear : meets an edge face instead of the rear surface.  total_internal : totally reflected, or
        refracted backwards.
    unresolved : the search for the front or the rear failed.
    on_target, off_target : leaves the lens and meets the target rectangle or misses it.
    """

    beside_lens: float
    front_reflected: float
    missed_rear: float
    unresolved: float
    total_internal: float
    rear_reflected: float
    on_target: float
    off_target: float

    @property
    def transmitted(self) -> float:
        return self.on_target + self.off_target

    def __add__(self, other: FluxBudget) -> FluxBudget:
        return FluxBudget(*(a + b for a, b in zip(asdict(self).values(), asdict(other).values())))


class Tracer:
    """Rays of one source through a lens whose sags may change.

    lens : Lens.  rays : Beam or Rays.  target_z : mm, inf is the far field.
    soft_rim : share of the half-width within which the flux of rays in any direction fades towards the rim
        of a surface that carries a sag, so that light which goes over the rim is lost smoothly.
    sure : grazing rays are led to the first of several meetings with a rough surface; costs up to twice the
        time.
    """

    def __init__(
        self,
        backend: Backend,
        lens: Lens,
        rays: Beam | Rays,
        target_z: float,
        soft_rim: float = 0.0,
        sure: bool = True,
    ) -> None:
        self._backend, self._lens, self._soft_rim = backend, lens, soft_rim
        dr, Float = backend.dr, backend.Float
        self._emitted = rays.entering
        self._missed = rays.missed if isinstance(rays, Beam) else 0.0
        # opaque numbers do not become part of the kernels, which then serve every source and lens
        self._index, self._inverse = dr.opaque(Float, lens.index), dr.opaque(Float, 1 / lens.index)
        self._distance = None if isinf(target_z) else dr.opaque(Float, target_z - lens.thickness)
        self._flux = (
            dr.opaque(Float, rays.ray_flux) if np.isscalar(rays.ray_flux) else backend.array(rays.ray_flux)
        )
        self._embeddings = [s.sag.space.embedding for s in (lens.front, lens.rear) if s.sag is not None]
        self._front: SearchedHits | None = None
        self._rear: KnownHits | SearchedHits
        if isinstance(rays, Beam) and lens.front.sag is None and lens.front.conic.is_plane:
            self._rear = KnownHits(backend, rays, lens.rear.conic, lens.rear.half_width, _knots(lens.rear))
            direction = (0.0, 0.0, 1.0)
            _, share, _ = refract(dr, direction, (Float(0), Float(0)), self._inverse)
            entering = self._flux * share
            dr.make_opaque(entering)
            self._behind = _Bundle(None, direction, entering, True, True)
        else:
            rays = beam_rays(rays, lens) if isinstance(rays, Beam) else rays
            self._origin, self._direction = (
                [backend.array(a) for a in rows] for rows in (rays.origin, rays.direction)
            )
            self._front = SearchedHits(
                backend, lens.front.conic, lens.front.half_width, _knots(lens.front), sure
            )
            self._rear = SearchedHits(backend, lens.rear.conic, lens.rear.half_width, _knots(lens.rear), sure)
            if lens.front.sag is None:
                _, self._behind = self._through_front(None)
                dr.eval(self._behind.origin, self._behind.direction, self._behind.flux)
        self._width = len(rays.x) * len(rays.y) if isinstance(rays, Beam) else rays.origin.shape[1]

    def trace(self, coefficients: Sequence[NDArray[np.float64]]) -> tuple[list[Hits], Landing]:
        """Return (Hits of every surface that carries a sag, Landing), differentiable in the hits' leaves.

        coefficients : of the sags, (dim,) each, front first.
        """
        changing, hits, behind = self._meet(coefficients)
        return changing, self._landing(hits, behind)

    def at_rear(self, coefficients: Sequence[NDArray[np.float64]]) -> tuple[Hits, Vector, DrArray]:
        """Return (Hits of the rear, directions inside the lens, flux inside the lens, zero for rays that
        miss)."""
        _, hits, behind = self._meet(coefficients)
        return hits, behind.direction, self._backend.dr.select(hits.hit, behind.flux, 0)

    def _meet(self, coefficients: Sequence[NDArray[np.float64]]) -> tuple[list[Hits], Hits, _Bundle]:
        """Return (Hits of the surfaces that carry a sag, Hits of the rear, what meets the rear)."""
        nets = [e.coefficients(c) for e, c in zip(self._embeddings, coefficients)]
        changing = []
        behind = self._behind if self._lens.front.sag is None else None
        if behind is None:
            front, behind = self._through_front(nets[0])
            changing.append(front)
        net = None if self._lens.rear.sag is None else nets[-1]
        hits = (
            self._rear.meet(net)
            if isinstance(self._rear, KnownHits)
            else self._rear.meet(behind.origin, behind.direction, net)
        )
        if net is not None:
            changing.append(hits)
        return changing, hits, behind

    def pull_back(
        self, hits: Sequence[Hits], knots: Sequence[Sequence[KnotVector] | None] | None = None
    ) -> list[NDArray[np.float64]]:
        """Return the derivative by each sag's coefficients, or by a net over other knots, after
        `dr.backward`."""
        self._backend.dr.eval(
            [leaf.grad for h in hits for leaf in h.leaves]
        )  # of all surfaces together: they share most of the way
        searched = [self._front] * (self._lens.front.sag is not None) + [self._rear] * (
            self._lens.rear.sag is not None
        )
        if knots is not None:
            return [s.pull_back(h.gradients(), k) for s, h, k in zip(searched, hits, knots)]
        return [e.adjoint(s.pull_back(h.gradients())) for e, s, h in zip(self._embeddings, searched, hits)]

    def budget(self, landing: Landing, half_width: tuple[float, float]) -> FluxBudget:
        """Return the FluxBudget of a traced landing for a target rectangle."""
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
        at_rear = total(landing.entering, landing.hit)
        refracted = total(landing.entering, landing.hit & landing.refracted)
        arriving = total(landing.flux, True)
        on_target = total(landing.flux, onto)
        return FluxBudget(
            beside_lens=self._missed + self._emitted - lost_before - met,
            front_reflected=met - inside,
            missed_rear=found - at_rear,
            unresolved=lost_before + lost_inside,
            total_internal=at_rear - refracted,
            rear_reflected=refracted - arriving,
            on_target=on_target,
            off_target=arriving - on_target,
        )

    def counts(self, landing: Landing, half_width: tuple[float, float]) -> dict[str, int]:
        """Return how many rays have each fate; reflected light has none of its own, it splits off rays that
        go on."""
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

    def _through_front(self, net: NDArray[np.float64] | None) -> tuple[Hits, _Bundle]:
        """Return the front's Hits and what goes on behind it."""
        hits = self._front.meet(self._origin, self._direction, net)
        direction, share, _ = refract(self._backend.dr, self._direction, (hits.zx, hits.zy), self._inverse)
        flux = self._backend.dr.select(hits.hit, self._flux * share * self._rim(hits, self._lens.front), 0)
        return hits, _Bundle(
            (hits.x, hits.y, hits.z - self._lens.thickness), direction, flux, hits.found, hits.hit
        )

    def _landing(self, hits: Hits, behind: _Bundle) -> Landing:
        dr = self._backend.dr
        (dx, dy, dz), share, refracted = refract(dr, behind.direction, (hits.zx, hits.zy), self._index)
        forward = refracted & (dz > 0)
        arrives = hits.hit & forward
        flux = dr.select(arrives, behind.flux * share * self._rim(hits, self._lens.rear), 0)
        dz = dr.select(forward, dz, 1)
        if self._distance is None:
            degrees = 180 / np.pi
            x, y = (degrees * dr.atan(d / dz) for d in (dx, dy))
        else:
            travel = (self._distance - hits.z) / dz
            x, y = hits.x + travel * dx, hits.y + travel * dy
        return Landing(
            x, y, dx, dy, flux, behind.flux, behind.decided, behind.met, hits.found, hits.hit, forward
        )

    def _rim(self, hits: Hits, surface: FreeformSurface) -> DrArray:
        """Return 1 inside a surface, falling to 0 at its rim by 3 s^2 - 2 s^3."""
        if not self._soft_rim or surface.sag is None or isinstance(self._rear, KnownHits):
            return 1.0
        share = 1.0
        for a, h in zip((hits.x, hits.y), surface.half_width):
            s = self._backend.dr.clip((h - self._backend.dr.abs(a)) * (1 / (self._soft_rim * h)), 0, 1)
            share = share * (s * s * (3 - 2 * s))
        return share


def _knots(surface: FreeformSurface) -> tuple[KnotVector, KnotVector] | None:
    """Return the knots in mm of a sag's tensor-product form."""
    if surface.sag is None:
        return None
    embedding = surface.sag.space.embedding
    kv_x, kv_y = (kv.rescaled(-h, h) for kv, h in zip((embedding.kv_u, embedding.kv_v), surface.half_width))
    return kv_x, kv_y
