"""Checks of the light through the faces of a STEP file, by the reference tracer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from optics.runtime import Check
from optics.verification.reference_tracer import trace_step
from optics.verification.trace_comparison import compared

if TYPE_CHECKING:
    from optics.runtime import Backend
    from optics.sources import Rays
    from optics.system import OpticalSystem
    from optics.tracing import LandingPoints
    from optics.verification.reference_tracer import OpticalFaces
    from thbcad.lens import Lens


def light_checks(system: OpticalSystem, lens: Lens, step: OpticalFaces, backend: Backend) -> list[Check]:
    """Return the Checks of the light through the front and the rear of a STEP file, as read back from it.

    backend : of double precision.
    """
    limits = system.problem.verify

    def by_scipy(rays: Rays) -> LandingPoints:
        return trace_step(step, rays.origin.T, rays.direction.T, rays.flux, lens.index, system.target.z)

    seen = compared(system, lens, backend, [limits.rays] * 2, by_scipy)
    return [
        Check("rays with another fate in the independent trace", seen.mismatched, 0, ""),
        Check("landing points, independent trace of the file", seen.landing, limits.landing, seen.unit),
        Check("irradiance, independent trace of the file, relative", seen.irradiance, limits.irradiance, ""),
    ]
