"""Rays through the lens's meshes, traced by Mitsuba: front, rear, target.

The pipeline of the exact tracer with one part exchanged: where a ray meets a surface, and the normal there,
come from `Scene.ray_intersect` in single precision, the normal interpolated between the vertices.  Every
surface is a scene of its own, so that no ray starts on a mesh that it can meet again, and Embree's robust
tests let no ray slip through between two triangles: without them those on the grid lines do, and cost 5e-3 of
the irradiance.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isinf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.engines import TracedModel
from optics.mitsuba.loading import current_mitsuba, mitsuba_backend
from optics.mitsuba.mesh import LensMesh
from optics.optimisation import Objective
from optics.sources import RayGrid, Rays
from optics.target import Splat
from optics.tracing import Landing, device_flux, refract

if TYPE_CHECKING:
    from optics.runtime import DrArray
    from optics.system import OpticalSystem
    from optics.target import Window
    from thbcad.lens import Lens
    from thbcad.splines import KnotVector

    Vector = tuple[DrArray, DrArray, DrArray]


class MeshTracer:
    """Rays of one source through the meshes of a lens whose sags may change: a `RayTracer`.

    A front without sag is traced once.  target_z : mm, inf is the far field.
    """

    def __init__(self, mesh: LensMesh, rays: RayGrid | Rays, target_z: float) -> None:
        self._mitsuba, self._mesh, self._target_z = current_mitsuba(), mesh, target_z
        self.backend = mitsuba_backend(self._mitsuba, "single")
        dr, Float = self.backend.dr, self.backend.Float
        self._index = {
            "front": dr.opaque(Float, 1 / mesh.lens.index),
            "rear": dr.opaque(Float, mesh.lens.index),
        }
        robust = {"type": "scene", "embree_use_robust_intersections": True}
        shapes = mesh.shapes(self._mitsuba, tuple(mesh.surfaces))
        self._scenes = {
            name: self._mitsuba.load_dict(robust | {name: shape}) for name, shape in shapes.items()
        }
        self._parameters = [self._mitsuba.traverse(self._scenes[name]) for name in mesh.free]
        self._flux = device_flux(self.backend, rays.flux)
        rays = rays.rays(_before(mesh)) if isinstance(rays, RayGrid) else rays
        ox, oy, oz = (self.backend.array(row) for row in rays.origin)
        dx, dy, dz = (self.backend.array(row) for row in rays.direction)
        self._origin, self._direction = (ox, oy, oz), (dx, dy, dz)
        self._behind = None if "front" in mesh.free else self._through_front()
        dr.eval(self._behind)

    def trace(self, coefficients: Sequence[NDArray[np.float64]]) -> tuple[list[DrArray], Landing]:
        """Return (leaves, Landing), differentiable in the leaves: the coefficients of every sag, front
        first."""
        double = mitsuba_backend(self._mitsuba)
        leaves = [double.array(c) for c in coefficients]
        double.dr.enable_grad(*leaves)
        for parameters in self._parameters:
            self._mesh.update(self._mitsuba, parameters, leaves)
        return leaves, self.landing()

    def landing(self) -> Landing:
        """Return the Landing of the meshes as they are."""
        dr = self.backend.dr
        origin, direction, entering, met = self._behind or self._through_front()
        point, (dx, dy, dz), flux, hit = self._through("rear", origin, direction, entering)
        forward = dz > 0
        dz = dr.select(forward, dz, 1)
        if isinf(self._target_z):
            x, y = (dr.atan(d / dz) * (180 / np.pi) for d in (dx, dy))
        else:
            travel = (dr.opaque(self.backend.Float, self._target_z) - point[2]) / dz
            x, y = point[0] + travel * dx, point[1] + travel * dy
        always = dr.ones(dr.mask_t(hit), 1)
        return Landing(
            x=x,
            y=y,
            p=dx,
            q=dy,
            flux=dr.select(hit & forward, flux, 0),
            entering=entering,
            decided=always,
            met=met,
            found=always,
            hit=hit,
            refracted=forward,
        )

    def pull_back(
        self, leaves: Sequence[DrArray], knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[NDArray[np.float64]]:
        """Return the derivative by each sag's coefficients after `dr.backward`.

        Raises
        ------
        ValueError : knots; a mesh follows the coefficients of its lens only.
        """
        if knots is not None:
            raise ValueError("a mesh has derivatives by the coefficients of its lens only")
        return [np.array(np.broadcast_to(leaf.grad.numpy(), len(leaf))) for leaf in leaves]

    def set_directions(
        self, leaves: Sequence[DrArray], directions: Sequence[NDArray[np.float64]]
    ) -> list[DrArray]:
        """Set the derivatives of the leaves to a direction in the coefficients; return them."""
        double = mitsuba_backend(self._mitsuba)
        for leaf, direction in zip(leaves, directions):
            double.dr.set_grad(leaf, double.array(direction))
        return list(leaves)

    def _through_front(self) -> tuple[Vector, Vector, DrArray, DrArray]:
        return self._through("front", self._origin, self._direction, self._flux)

    def _through(
        self, name: str, origin: Vector, direction: Vector, flux: DrArray
    ) -> tuple[Vector, Vector, DrArray, DrArray]:
        """Return (meeting point, refracted direction, flux, met).

        flux : zero for rays that do not pass.  met : the mask of rays that meet the surface.
        """
        mi, dr = self._mitsuba, self.backend.dr
        ray = mi.Ray3f(mi.Point3f(*origin), mi.Vector3f(*direction))
        meeting = self._scenes[name].ray_intersect(
            ray, ray_flags=mi.RayFlags.All, coherent=True, active=flux > 0
        )
        normal, hit = meeting.sh_frame.n, meeting.is_valid()
        zx, zy = (dr.select(hit, -a / normal.z, 0) for a in (normal.x, normal.y))
        refracted, transmittance, _ = refract(dr, direction, (zx, zy), self._index[name])
        x, y, z = meeting.p
        return (x, y, z), refracted, dr.select(hit, flux * transmittance, 0), hit


def _before(mesh: LensMesh) -> float:
    """Return z of a plane a thickness before the lens, mm."""
    return float(mesh.surfaces["front"].jet()[0].min() - mesh.lens.thickness)


def mesh_irradiance(
    system: OpticalSystem,
    lens: Lens,
    counts: Sequence[int],
    window: Window,
    vertices: Sequence[int],
) -> NDArray[np.float64]:
    """Return the irradiance on the target's pixels, (rows, columns), W/mm^2.

    In the far field it is in W per square degree.

    counts : (nx, ny) of the system's rays.  vertices : (nx, ny) of front and rear.
    """
    tracer = MeshTracer(LensMesh.uniform(lens, vertices), system.source.rays(counts), system.target.z)
    screen = system.target.screen()
    landing = tracer.landing()
    image = Splat(tracer.backend, screen, window)(landing.x, landing.y, landing.flux)
    return image.numpy().astype(np.float64).reshape(screen.padded, order="F")


def mesh_pipeline(
    system: OpticalSystem,
    lens: Lens,
    counts: Sequence[int],
    window: Window,
    vertices: Sequence[int],
    margin: int = 0,
) -> Objective:
    """Return loss and gradient through Mitsuba: an `Objective` over a `MeshTracer`, with only its first term.

    The target is the system's, with the whole source flux.  counts : (nx, ny) of the system's rays.
    vertices : (nx, ny) of front and rear.  margin : dark pixels around the target.
    """
    tracer = MeshTracer(LensMesh.uniform(lens, vertices), system.source.rays(counts), system.target.z)
    screen = system.target.screen(margin=margin)
    target = system.target.irradiance(screen, system.problem.source.flux)
    return Objective(TracedModel(tracer.backend, tracer, screen, window), target, 0.0)
