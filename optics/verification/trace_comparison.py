"""The same rays by the optimiser's tracer and by another: how far their landing points, fates and irradiance
are apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.sources import single_rays
from optics.tracing import Tracer
from optics.verification.reference_tracer import deposit

if TYPE_CHECKING:
    from optics.runtime import Backend
    from optics.sources import Rays
    from optics.system import OpticalSystem
    from optics.tracing import LandingPoints
    from thbcad.lens import Lens


@dataclass(frozen=True)
class Comparison:
    """How far two traces are apart.

    landing : mm, degrees in the far field; the greatest error of a coordinate on the target, inf where no ray
        lands there
    irradiance : relative L2 difference on the target's pixels.  mismatched : rays that arrive in one of them
        only
    unit : of landing
    """

    landing: float
    irradiance: float
    mismatched: int
    unit: str


def compared(
    system: OpticalSystem,
    lens: Lens,
    backend: Backend,
    counts: Sequence[int],
    other: Callable[[Rays], LandingPoints],
) -> Comparison:
    """Trace rays of the system's source through the lens in memory and by `other`, and return their
    Comparison.

    backend : of double precision.  counts : of rays, as in `LightSource.rays`.
    other : of Rays, returns where they land and the flux that arrives, zero for rays that do not.
    """
    rays = system.source.rays(counts)
    _, landing = Tracer(backend, lens, rays, system.target.z).trace([sag.coefficients for sag in lens.sags])
    points, flux = np.column_stack([landing.x.numpy(), landing.y.numpy()]), landing.flux.numpy()
    found, screen = other(single_rays(rays, lens)), system.target.screen()
    # beside the target lands light that leaves at grazing angles: the last digit of a slope moves it by far
    both = (flux > 0) & (found.flux > 0) & (np.abs(points) <= screen.half_width).all(axis=1)
    error = float(np.abs(points[both] - found.points[both]).max()) if both.any() else np.inf
    unit = "degrees" if screen.angular else "mm"
    difference = _difference(
        *(deposit(p, f, screen) for p, f in ((points, flux), (found.points, found.flux)))
    )
    return Comparison(error, difference, int(((flux > 0) != (found.flux > 0)).sum()), unit)


def _difference(own: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    norm = np.linalg.norm(own)
    return float(np.linalg.norm(own - other) / norm) if norm else np.inf
