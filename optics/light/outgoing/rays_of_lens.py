"""The light behind a lens, a mirror or a row as rays: for ray files, which other programs go on with."""

from __future__ import annotations

from math import isqrt
from typing import Literal

import numpy as np

from optics.base.runtime import Backend, UserError
from optics.light.tracing import Tracer
from optics.scene.ray_files import RaySet
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens


def outgoing_rays(system: OpticalSystem, lens: Lens, backend: Backend, count: int, place: str) -> RaySet:
    """Return about `count` rays of the source that went over all faces, in the unit of its flux.

    place : where the rays start: on the last face, "rear", or on the "target"; in the frame of the scene.
    backend : of double precision.

    Light that edges and inner reflections send on is not among them.

    Raises UserError : rays from the target in the far field, which has no place.
    """
    if place == "target" and system.target.far_field:
        raise UserError("the far field has no plane that rays may start from; take --light rear")
    side = isqrt(count - 1) + 1
    rays = system.source.rays((side, side))
    path = system.path(lens)
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
    wavelength = np.full(int(out.sum()), system.problem.source.wavelength)
    unit: Literal["W", "lm"] = "lm" if system.units.luminous else "W"
    return RaySet(position[out], direction[out], flux[out], unit, wavelength)
