"""Does the file on disk make the light?  Checks of a STEP file against the designed lens."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.runtime import Check
from optics.verification.reference_tracer import trace_step
from optics.verification.trace_comparison import compared
from thbcad.cad.exchange import solid_volume, step_bytes
from thbcad.lens import placed_surfaces
from thbcad.splines import BSplineSurface

if TYPE_CHECKING:
    from optics.runtime import Backend
    from optics.sources import Rays
    from optics.system import OpticalSystem
    from optics.tracing import LandingPoints
    from optics.verification.step_file import StepFile
    from thbcad.lens import FreeformSurface, Lens
    from thbcad.splines import KnotVector, NURBSSurface

TOLERANCE = 1e-6  # mm
FINE_VOLUME = 1e-9  # relative
SURFACE_SAMPLES = 6  # per knot span and direction


def verify(system: OpticalSystem, lens: Lens, file: StepFile, backend: Backend) -> list[Check]:
    """Return the list of Checks of a STEP file as OCCT reads it against the lens in memory.

    backend : of double precision.
    """
    step, fresh = file.solid, step_bytes(lens, system.product, system.problem.export.schema)
    limits = system.problem.verify
    checks = [
        Check("solids besides the one expected", abs(step.solids - 1), 0, ""),
        Check("faces besides the six expected", abs(step.faces - 6), 0, ""),
        Check("free edges", step.free_edges, 0, ""),
        Check("tolerance that faces, edges and vertices need to meet", step.tolerance, TOLERANCE, "mm"),
        Check(
            "file differs from a fresh export of the lens by this version",
            int(file.path.read_bytes() != fresh),
            0,
            "",
        ),
        Check("shell not closed", int(not step.closed), 0, ""),
        Check("solid not valid (OCCT)", int(not step.valid), 0, ""),
    ]
    volume = lens.volume()
    off = abs(step.volume / volume - 1)
    if off > limits.volume:  # OCCT's estimate of its own error is too low on rough surfaces: ask for more
        off = abs(solid_volume(step.shape, FINE_VOLUME) / volume - 1)
    checks.append(Check("volume by OCCT against the closed form, relative", off, limits.volume, ""))
    for name, read, own in zip(("front", "rear"), (step.front, step.rear), placed_surfaces(lens)):
        checks.append(
            Check(
                f"{name} poles and knots that differ from the lens in memory",
                differing_numbers(read, own),
                0,
                "",
            )
        )
    for name, read, surface, vertex in (
        ("front", step.front, lens.front, 0.0),
        ("rear", step.rear, lens.rear, lens.thickness),
    ):
        checks.append(
            Check(
                f"{name} face against the lens in memory",
                surface_deviation(read, surface, vertex),
                limits.surface,
                "mm",
            )
        )

    def by_scipy(rays: Rays) -> LandingPoints:
        return trace_step(step, rays.origin.T, rays.direction.T, rays.flux, lens.index, system.target.z)

    found = compared(system, lens, backend, [limits.rays] * 2, by_scipy)
    checks += [
        Check("rays with another fate in the independent trace", found.mismatched, 0, ""),
        Check("landing points, independent trace of the file", found.landing, limits.landing, found.unit),
        Check("irradiance, independent trace of the file, relative", found.irradiance, limits.irradiance, ""),
    ]
    return checks


def surface_deviation(face: BSplineSurface, surface: FreeformSurface, vertex: float) -> float:
    """Return the greatest |z_face(x, y) - z_surface(x, y)| in mm at points within every knot span.

    face : BSplineSurface with poles (x, y, z).  surface : FreeformSurface at z = vertex.
    """
    u, v = (_samples(kv) for kv in (face.kv_u, face.kv_v))
    points = face.grid(u, v)
    x, y = points[:, 0, 0], points[0, :, 1]
    bent = max(np.abs(points[..., 0] - x[:, None]).max(), np.abs(points[..., 1] - y[None, :]).max())
    hx, hy = surface.half_width
    size = max(abs(np.abs(x).max() - hx), abs(np.abs(y).max() - hy))
    z = vertex + surface.grid(np.clip(x, -hx, hx), np.clip(y, -hy, hy))
    return float(max(np.abs(points[..., 2] - z).max(), bent, size))


def _samples(kv: KnotVector) -> NDArray[np.float64]:
    b = kv.breaks
    inner = (b[:-1, None] + np.diff(b)[:, None] * (np.arange(SURFACE_SAMPLES) / SURFACE_SAMPLES)).ravel()
    return np.append(inner, b[-1])


def differing_numbers(read: BSplineSurface | NURBSSurface | None, own: BSplineSurface) -> int:
    """Return how many coordinates and knots of a face differ from those in memory; all of them where their
    number does."""
    everything = own.coefficients.size + len(own.kv_u.knots) + len(own.kv_v.knots)
    if not isinstance(read, BSplineSurface) or read.coefficients.shape != own.coefficients.shape:
        return everything
    if any(len(a.knots) != len(b.knots) for a, b in ((read.kv_u, own.kv_u), (read.kv_v, own.kv_v))):
        return everything
    knots = sum(int((a.knots != b.knots).sum()) for a, b in ((read.kv_u, own.kv_u), (read.kv_v, own.kv_v)))
    return int((read.coefficients != own.coefficients).sum()) + knots
