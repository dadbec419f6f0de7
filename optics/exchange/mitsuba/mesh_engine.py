"""The engine "mitsuba-mesh": rays through meshes of the lens, traced by Mitsuba.

Normals are those of the splines at the vertices and interpolated between them, so that slopes err by
h^2 / 8 of their second derivative, with the spacing h of the vertices.  At least PER_SPAN of these lie on
every knot span of the finest level, on which the optimiser bends the surface.  Mitsuba meets the triangles in
single precision, and derivatives pass through float32.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from optics.base.runtime import Backend
from optics.exchange.mitsuba.mesh import LensMesh
from optics.exchange.mitsuba.mesh_tracer import MeshTracer
from optics.exchange.mitsuba.scene import require_open
from optics.light.engines import SOFT_RIM, Film, TracedModel, measured_rays
from optics.scene.sources import RayGrid, Rays
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens

PER_SPAN = 2  # least vertices per knot span of the finest level, in each direction
FEWEST = 448  # spaces between the vertices, in each direction
INSIDE = 1 - 1e-6  # of the half-width: a ray on the rim itself could miss the mesh in single precision


@dataclass(frozen=True, eq=False)
class MeshEngine:
    """Light models of rays through meshes: an `Engine`.

    backend : of Mitsuba's single precision.
    """

    backend: Backend

    def model(self, system: OpticalSystem, lens: Lens, film: Film) -> TracedModel:
        """Return the light model of a system with the meshes of a lens, see `Engine`.

        Raises
        ------
        UserError : as `require_open`.
        """
        require_open(system)
        rays, window, mirrors = measured_rays(self.backend, system, lens, film)
        tracer = MeshTracer(
            lens_mesh(lens),
            _within(rays, lens),
            system.target.receiver,
            soft_rim=0.0 if system.parallel else SOFT_RIM,
            fresnel=system.problem.optimizer.fresnel,
        )
        return TracedModel(self.backend, tracer, film.screen, window, mirrors)


def lens_mesh(lens: Lens) -> LensMesh:
    """Return a lens's mesh with PER_SPAN vertices per knot span of its finest level, or more."""
    spaces = [sag.space for sag in lens.sags]
    spans = [
        max(row) << max(space.levels - 1 for space in spaces)
        for row in zip(*((space.kv_u.spans, space.kv_v.spans) for space in spaces))
    ]
    return LensMesh.uniform(lens, [n * max(PER_SPAN, ceil(FEWEST / n)) + 1 for n in spans])


def _within(rays: RayGrid | Rays, lens: Lens) -> RayGrid | Rays:
    """Return the rays of a beam, with those on the rim of a surface led just within."""
    if not isinstance(rays, RayGrid):
        return rays
    lines = []
    for line, half_widths in zip((rays.x, rays.y), zip(lens.front.half_width, lens.rear.half_width)):
        for h in half_widths:
            line = np.where(np.abs(np.abs(line) - h) <= (1 - INSIDE) * h, INSIDE * np.sign(line) * h, line)
        lines.append(line)
    x, y = lines
    return replace(rays, x=x, y=y)
