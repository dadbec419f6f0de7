"""One surface of a light path on the device: where rays meet it, and how they go on.

Light along z that comes through a plane is still parallel: it meets the surface behind at known points.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import (
    DeviceRays,
    Hits,
    KnownHits,
    SearchedHits,
    Stokes,
    Vector,
    gauge,
    raised_hits,
    rim_fade,
)
from optics.light.tracing.obstructions import Obstruction
from optics.light.tracing.refraction import (
    Mueller,
    at_face,
    reflect,
    reflection,
    refract,
    transmission,
    uniform,
)
from optics.scene.paths import LightPath, Medium, Surface
from optics.scene.sources import RayGrid
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface
from thbcad.splines import KnotVector

RAISING_STEPS = 6  # at most: an error of 1 um with slopes of 1e-3 takes one, a gross one of 0.01 mm three


@dataclass(eq=False)
class Passage:
    """What becomes of rays at a surface.

    before : the rays that come, in its frame.
    found : as in Hits.  hit : as there, of rays that nothing blocks.  goes_on : the mask of rays that are
        refracted forward, or reflected.
    reaching : flux at the surface, W: what absorption leaves of that behind the one before.
    leaving : flux that goes on, zero of all other rays.
    blocked : rays that stops on their way take, or a holder on the surface.  again : of these, those that
        meet the surface before once more.
    """

    before: DeviceRays
    found: DrArray | bool
    hit: DrArray | bool
    goes_on: DrArray | bool
    reaching: DrArray
    leaving: DrArray
    blocked: DrArray | bool = False
    again: DrArray | bool = False


class TracedSurface:
    """A surface and the media on its two sides.

    hits : what finds meeting points.  media : before the surface and behind it.
    soft_rim : as of `LightPath`; 0 is a hard rim.
    """

    def __init__(
        self,
        backend: Backend,
        surface: Surface,
        media: tuple[Medium, Medium],
        hits: KnownHits | SearchedHits,
        soft_rim: float,
    ) -> None:
        self.surface, self.hits = surface, hits
        self._backend, self._soft_rim = backend, soft_rim
        before, behind = media[0], surface.beyond if surface.kind == "reflect" else media[1]
        self._eta = backend.opaque(before.index / behind.index)
        self._absorption = backend.opaque(before.absorption) if before.absorption else None
        error = surface.slope_error
        self._slope_error = error if error is None else [*map(backend.array, error)]

    def meet(self, rays: DeviceRays, net: Floats | None) -> Hits:
        """Return the Hits of rays in the surface's own frame.  net : of its sag, where it has one."""
        error, known = self.surface.height_error, isinstance(self.hits, KnownHits)

        def meet(height: DrArray | float) -> Hits:
            if isinstance(self.hits, KnownHits):
                assert net is not None
                return self.hits.meet(net)
            x, y, z = rays.origin
            return self.hits.meet((x, y, z - height), rays.direction, net)

        if error is None:
            return meet(0.0)
        return raised_hits(self._backend, error, meet, 0 if known else RAISING_STEPS)

    def kept(
        self, hit: DrArray | bool, taken: DrArray | bool, x: DrArray, y: DrArray
    ) -> tuple[DrArray | bool, DrArray | bool]:
        """Return the masks of rays that come through to the surface, and of those that are blocked.

        hit : rays that meet it within its rim, at x and y.  taken : by stops before.
        """
        clear = self.surface.clear
        if clear is None:
            return (hit, taken) if taken is False else (hit & ~taken, taken)
        beside = hit & (gauge(self._backend, clear, x, y) > 1)
        blocked = beside if taken is False else beside | taken
        return hit & ~blocked, blocked

    def passed(
        self, rays: DeviceRays, hits: Hits, hit: DrArray, blocked: DrArray | bool, polarised: bool
    ) -> tuple[Passage, Vector, Stokes | None]:
        """Return what becomes of rays that met the surface, the directions in which they go on, and their
        polarisation there.

        Directions of rays that do not go on mean nothing.  hit, blocked : see `kept`.
        polarised : the polarisation behind the surface matters; else None stands for it.
        """
        dr, error = self._backend.dr, self._slope_error
        slopes = (hits.zx, hits.zy) if error is None else (hits.zx + error[0], hits.zy + error[1])
        direction, share, goes_on = self.turned(rays.direction, slopes)
        if self.surface.kind == "refract":
            goes_on = goes_on & (direction[2] > 0)
        stokes = None
        if polarised or rays.stokes is not None:
            share, stokes = self._polarised(rays, slopes)
        reaching = self.reaching(rays, hits)
        passing = reaching * share * self._rim(hits)
        leaving = dr.select(hit & goes_on, passing, 0)
        passage = Passage(rays, hits.found, hit, goes_on, reaching, leaving, blocked)
        return passage, direction, stokes if polarised else None

    def turned(self, direction: Vector, slope: tuple[DrArray, DrArray]) -> tuple[Vector, DrArray, DrArray]:
        """Return directions behind it, the share of light that goes on, and the mask of these rays."""
        turn = reflect if self.surface.kind == "reflect" else refract
        out, share, goes_on = turn(self._backend.dr, direction, slope, self._eta)
        if self.surface.share is not None:
            share = self._backend.dr.select(goes_on, self._backend.Float(self.surface.share), 0)
        return out, share, goes_on

    def _polarised(self, rays: DeviceRays, slope: tuple[DrArray, DrArray]) -> tuple[DrArray, Stokes]:
        """Return the share of light that goes on, and its polarisation behind the surface."""
        dr, (dx, dy, dz), (zx, zy) = self._backend.dr, rays.direction, slope
        cosine = (dz - dx * zx - dy * zy) * dr.rsqrt(1 + zx * zx + zy * zy)
        return at_face(dr, rays.stokes, rays.direction, (-zx, -zy, 1.0), self._mueller(cosine))

    def _mueller(self, cosine: DrArray) -> Mueller:
        """Return its matrix at cosines of the angle of incidence."""
        reflects, share = self.surface.kind == "reflect", self.surface.share
        if share is not None:
            return uniform(self._backend.Float(share), reflects)
        return (reflection if reflects else transmission)(self._backend.dr, cosine, self._eta)

    def reaching(self, rays: DeviceRays, hits: Hits) -> DrArray:
        """Return the flux that absorption leaves of rays on their way to the surface, exp(-a t)."""
        if self._absorption is None:
            return rays.flux
        dr = self._backend.dr
        path = (hits.z - rays.origin[2]) / rays.direction[2]
        return rays.flux * dr.exp(-self._absorption * dr.select(hits.hit, path, 0))

    def _rim(self, hits: Hits) -> DrArray | float:
        """Return 1 inside the surface, falling to 0 at its rim, see `rim_fade`."""
        if not self._soft_rim or isinstance(self.hits, KnownHits):
            return 1.0
        return rim_fade(self._backend, (hits.x, hits.y), self.surface.open, self._soft_rim)


def knots_of(shape: FreeformSurface) -> tuple[KnotVector, KnotVector] | None:
    """Return the knots in mm of a sag's tensor-product form."""
    if shape.sag is None:
        return None
    embedding = shape.sag.space.embedding
    kv_x, kv_y = (kv.rescale(-h, h) for kv, h in zip((embedding.kv_u, embedding.kv_v), shape.half_width))
    return kv_x, kv_y


def through_plane(
    backend: Backend, plane: TracedSurface, grid: RayGrid, start: float, obstruction: Obstruction
) -> tuple[DrArray | bool, DrArray | bool]:
    """Return the masks of rays that come through a plane z = 0, and of those that are blocked before.

    start : z, mm, from which the rays come.  obstruction : before the plane.
    """
    outline, hit = plane.surface.shape.outline, True
    if outline.is_rectangle and not (obstruction or plane.surface.clear):
        return True, False
    x, y = (backend.array(row.ravel()) for row in np.meshgrid(grid.x, grid.y, indexing="ij"))
    if not outline.is_rectangle:
        hit = gauge(backend, outline, x, y) <= 1
    rays = DeviceRays((x, y, start), (0.0, 0.0, 1.0))
    taken, _ = obstruction.takes(rays, hit, -start)
    kept = plane.kept(hit, taken, x, y)
    backend.dr.eval(kept)
    return kept


def parted(backend: Backend, rays: DeviceRays, leaves: deque[DrArray]) -> DeviceRays:
    """Return the rays; what is behind them is differentiated back by a kernel of its own.

    One kernel for all surfaces has more numbers at once than a processor has registers: back over four
    surfaces it takes 3.2 times as long per surface as over two.

    leaves : empty; to be filled with those of the Hits of the surface that the rays come to.
    """
    operation = parting_operation(backend.dr.CustomOp)
    values = rays.origin, rays.direction, rays.flux, rays.stokes
    origin, direction, flux, stokes = backend.custom(operation, backend.dr, values, leaves)
    return replace(rays, origin=origin, direction=direction, flux=flux, stokes=stokes)


@cache
def parting_operation(base: type[Any]) -> type[Any]:
    """Return the operation (drjit, numbers, leaves) -> numbers of `parted`.  base : dr.CustomOp."""

    class Parted(base):
        def eval(self, dr: Any, numbers: Any, leaves: Any) -> Any:
            self.dr, self.leaves = dr, leaves
            return numbers

        def backward(self) -> None:
            slopes = self.grad_out()
            self.dr.eval(slopes, [leaf.grad for leaf in self.leaves])
            self.set_grad_in("numbers", slopes)

        def forward(self) -> None:
            self.set_grad_out(self.grad_in("numbers"))

    return Parted


def stays_parallel(path: LightPath) -> bool:
    """Whether light along z is still along z where it meets the second surface, which carries a sag."""
    if len(path.surfaces) < 2:
        return False
    first, second = path.surfaces[:2]
    return (
        second.shape.sag is not None
        and first.kind == "refract"
        and first.is_flat
        and first.pose.is_identity
        and not (second.pose.rotates or second.pose.shift[:2].any())
    )
