"""How far light moves on the target where the slope of a surface is off: exact, at every ray."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend
from optics.light.tracing import Tracer
from optics.scene.paths import LightPath, SlopeErrors
from optics.scene.sources import RayGrid, Rays
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens

Floats = NDArray[np.float64]

SURFACES = ("front", "rear")
TILT = 1e-5  # of the central differences: their error is its square, 1e-10, times the third derivative


@dataclass(frozen=True, eq=False)
class LandingResponse:
    """Rays that land on the target: where they cross a surface, how they follow its slope.

    landed : which of the rays that were traced these are, (m,) bool
    x, y : (n,) mm, on the surface.  flux : (n,)
    jacobian : (2, 2, n), d(landing x, y) / d(dz/dx, dz/dy): mm, in the far field degrees
    """

    landed: NDArray[np.bool_]
    x: Floats
    y: Floats
    flux: Floats
    jacobian: Floats


def landing_response(
    system: OpticalSystem, lens: Lens, backend: Backend, name: str, side: int
) -> LandingResponse:
    """Return the response to slopes of the "front" or the "rear", for about side x side rays of the source.

    Central differences of the exact trace; the surfaces stay where they are.
    """
    path, rays = system.path(lens), system.source.rays((side, side))
    x, y = crossings(path, backend, name, rays)
    half_width = system.target.screen().half_width
    columns, alive = [], np.ones(len(x), bool)
    flux = np.zeros(len(x))
    for tilt in np.eye(2) * TILT:
        ends = []
        for sign in (1.0, -1.0):
            errors = slope_errors(name, sign * tilt[:, None])
            points, flux = traced_points(path.with_slope_errors(errors), backend, rays)
            # light off the target blurs no picture; near total reflection it would outweigh all other
            alive &= (flux > 0) & (np.abs(points) <= np.array(half_width)[:, None]).all(axis=0)
            ends.append(points)
        columns.append((ends[0] - ends[1]) / (2 * TILT))
    jacobian = np.stack(columns, axis=1)
    return LandingResponse(alive, x[alive], y[alive], flux[alive], jacobian[..., alive])


def traced_points(path: LightPath, backend: Backend, rays: RayGrid | Rays) -> tuple[Floats, Floats]:
    """Return (landing points (2, n), flux (n,)) of rays along a path."""
    tracer = Tracer(backend, path, rays)
    with backend.dr.suspend_grad():
        _, landing = tracer.trace()
        every = backend.dr.zeros(backend.Float, rays.flux.size)
        arrays = [landing.x + every, landing.y + every, landing.flux + every]
        backend.dr.eval(arrays)
    x, y, flux = (a.numpy().astype(np.float64) for a in arrays)
    return np.stack([x, y]), flux


def crossings(path: LightPath, backend: Backend, name: str, rays: RayGrid | Rays) -> tuple[Floats, Floats]:
    """Return x and y, (n,) each, where rays cross a surface, inside it."""
    surface = SURFACES.index(name)
    tracer = Tracer(backend, path, rays if surface or isinstance(rays, Rays) else rays.rays(path.before))
    with backend.dr.suspend_grad():
        hits, _, _ = tracer.at(surface)
        every = backend.dr.zeros(backend.Float, rays.flux.size)
        arrays = [hits.x + every, hits.y + every]
        backend.dr.eval(arrays)
    half_width = path.surfaces[surface].shape.half_width
    x, y = (np.clip(a.numpy(), -h, h) for a, h in zip(arrays, half_width))
    return x, y


def slope_errors(name: str, error: Floats | None) -> SlopeErrors:
    """Return errors of the slopes of one surface, None is none."""
    return [error if name == surface else None for surface in SURFACES]
