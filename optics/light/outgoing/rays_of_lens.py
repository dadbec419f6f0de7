"""The light behind a lens, a mirror or a row as rays: for ray files, which other programs go on with."""

from __future__ import annotations

from math import isqrt
from typing import Literal

import numpy as np

from optics.base.runtime import Backend, UserError
from optics.light.tracing import Tracer
from optics.scene.paths import LightPath
from optics.scene.ray_files import RaySet
from optics.scene.sources import RayGrid, Rays
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.moulds import Plate


def outgoing_rays(system: System, backend: Backend, count: int, place: str) -> RaySet:
    """Return about `count` rays of the source that went over all faces, in the unit of its flux.

    Those of a plate are of all its lenses, at their places; those of a spectrum are of all its wavelengths.

    place : where the rays start: on the last face, "rear", or on the "target"; in the frame of the scene.
    backend : of double precision.

    Light that edges and inner reflections send on is not among them.

    Raises UserError : rays from the target in the far field, which has no place.
    """
    if place == "target" and system.target.far_field:
        raise UserError("the far field has no plane that rays may start from; take --light rear")
    made = system.made
    places = made.places if isinstance(made, Plate) else np.zeros((1, 2))
    side = isqrt((count - 1) // (len(places) * len(system.wavelengths))) + 1
    rays = system.source.rays((side, side))
    path = system.shaded_path
    sets = [
        _behind(system, path.in_media(wavelength.media), rays, place, backend)
        for wavelength in system.wavelengths
    ]
    shifts, parts = np.insert(places, 2, 0.0, axis=1)[:, None], []
    for wavelength, (position, direction, flux) in zip(system.wavelengths, sets):
        starts = position + shifts
        every = np.broadcast_to(wavelength.weight * flux, starts.shape[:2])
        along, nm = np.broadcast_to(direction, starts.shape), np.full(every.size, wavelength.nm)
        parts.append((starts.reshape(-1, 3), along.reshape(-1, 3), every.ravel(), nm))
    rows = (np.concatenate(row).astype(np.float32) for row in zip(*parts))
    unit: Literal["W", "lm"] = "lm" if system.units.luminous else "W"
    positions, directions, fluxes, nm = rows
    return RaySet(positions, directions, fluxes, unit, nm)


def _behind(
    system: System, path: LightPath, rays: RayGrid | Rays, place: str, backend: Backend
) -> tuple[Floats, Floats, Floats]:
    """Return position and direction, (n, 3) each, and flux, (n,), of the rays that leave the last face."""
    tracer, last = Tracer(backend, path, rays), len(path.surfaces) - 1
    with backend.dr.suspend_grad():
        hits, _, _ = tracer.at(last)
        _, landing = tracer.trace()
        values = [hits.x, hits.y, hits.z, landing.x, landing.y, landing.p, landing.q, landing.flux]
        backend.dr.eval(values)
    x, y, z, u, v, p, q, flux = (a.numpy() for a in values)
    out = flux > 0
    receiver = system.target.receiver
    own = np.stack([p, q, np.sqrt(np.maximum(1 - p * p - q * q, 0.0))])
    direction = receiver.pose.directions(own).T
    position = path.surfaces[last].pose.points(np.stack([x, y, z])).T
    if place == "target":
        position = np.stack(np.broadcast_arrays(*receiver.points(u, v)), axis=1)
    return position[out], direction[out], flux[out]
