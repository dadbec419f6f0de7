"""Sequential tracing: beam, front, rear, target plane.

The front surface is fixed and treated once.  Behind it the rays are either still parallel to
z (a plane front at normal incidence), so that their meeting points with the rear are known,
or they are searched for.  Every ray ends in exactly one of the fates that `FluxBudget` names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.hits import KnownHits, RearHits, SearchedHits, conic_jet
from optics.snell import refract

if TYPE_CHECKING:
    from optics.backend import Backend, DrArray
    from optics.beam import Beam
    from thbcad.bspline import KnotVector
    from thbcad.lens import Lens


@dataclass(eq=False)
class Landing:
    """Where rays meet the target plane: x, y in mm, flux in W (zero unless they arrive), and masks."""

    x: DrArray
    y: DrArray
    flux: DrArray
    hit: DrArray
    refracted: DrArray


@dataclass(frozen=True)
class FluxBudget:
    """The source flux by fate, in W; the fates sum to the source flux.

    beside_lens : passes beside the front.  front_reflected, rear_reflected : Fresnel losses.
    missed_rear : meets an edge face instead of the rear surface.  total_internal : totally reflected.
    on_target, off_target : leaves the lens and meets the target rectangle or misses it.
    """

    beside_lens: float
    front_reflected: float
    missed_rear: float
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
    """Rays of one beam through a lens whose rear sag is given as a tensor-product net.

    lens : Lens.  beam : Beam.  target_z : mm.  knots : knot vectors (x, y in mm) of the nets.
    """

    def __init__(self, backend: Backend, lens: Lens, beam: Beam, target_z: float, knots: Sequence[KnotVector]) -> None:
        self._backend = backend
        self._beam = beam
        dr, Float = backend.dr, backend.Float
        front = lens.front
        if front.sag is not None:
            raise ValueError("the front surface must be a plain conic: only the rear may carry a spline")
        self.parallel = front.conic.is_plane
        self._direction: tuple[DrArray, DrArray, DrArray] = (0.0, 0.0, 1.0)
        self.hits: KnownHits | SearchedHits
        if self.parallel:
            _, self._front_flux, _ = refract(dr, self._direction, (Float(0), Float(0)), 1 / lens.index)
            self.hits = KnownHits(backend, beam, lens.rear.conic, lens.rear.half_width, knots)
        else:
            x, y = (backend.array(a) for a in _mesh(beam))
            z, zx, zy, *_ = conic_jet(backend, front.conic, x, y)
            self._direction, self._front_flux, _ = refract(dr, self._direction, (zx, zy), 1 / lens.index)
            origin = (x, y, z - lens.thickness)
            dr.eval(origin, self._direction, self._front_flux)
            self.hits = SearchedHits(backend, origin, self._direction, lens.rear.conic, lens.rear.half_width, knots)
        # opaque numbers do not become part of the kernels, which then serve every beam and lens
        carried = dr.opaque(Float, beam.ray_flux) if np.isscalar(beam.ray_flux) else backend.array(beam.ray_flux)
        self._front_flux = self._front_flux * carried
        self._distance = dr.opaque(Float, target_z - lens.thickness)
        self._index = dr.opaque(Float, lens.index)
        dr.make_opaque(self._front_flux)

    def trace(self, net: NDArray[np.float64]) -> tuple[RearHits, Landing]:
        """Return (RearHits, Landing) for a sag net, differentiable in the hits' leaves."""
        dr = self._backend.dr
        hits = self.hits.evaluate(net)
        (dx, dy, dz), share, refracted = refract(dr, self._direction, (hits.zx, hits.zy), self._index)
        forward = refracted & (dz > 0)
        travel = (self._distance - hits.z) / dr.select(forward, dz, 1)
        arrives = hits.hit & forward
        flux = dr.select(arrives, self._front_flux * share, 0)
        return hits, Landing(hits.x + travel * dx, hits.y + travel * dy, flux, hits.hit, forward)

    def budget(self, landing: Landing, half_width: tuple[float, float]) -> FluxBudget:
        """Return the FluxBudget of a traced landing for a target rectangle."""
        dr, beam = self._backend.dr, self._beam
        width = len(beam.x) * len(beam.y)
        entering = self._front_flux + dr.zeros(self._backend.Float, width)
        onto = (dr.abs(landing.x) <= half_width[0]) & (dr.abs(landing.y) <= half_width[1])

        def total(values: DrArray, mask: DrArray) -> float:
            return float(dr.sum(dr.select(mask, values, 0)).numpy()[0])

        inside = total(entering, True)
        at_rear = total(entering, landing.hit)
        refracted = total(entering, landing.hit & landing.refracted)
        arriving = total(landing.flux, True)
        on_target = total(landing.flux, onto)
        return FluxBudget(
            beside_lens=beam.missed,
            front_reflected=beam.entering - inside,
            missed_rear=inside - at_rear,
            total_internal=at_rear - refracted,
            rear_reflected=refracted - arriving,
            on_target=on_target,
            off_target=arriving - on_target,
        )


def _mesh(beam: Beam) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, y = np.meshgrid(beam.x, beam.y, indexing="ij")
    return x.ravel(), y.ravel()
