"""Rays through the lens's meshes, traced by Mitsuba: front, rear, target.

The pipeline of the exact tracer with one part exchanged: a ray meets the triangle that Mitsuba finds for it,
in single precision, and the normal there is interpolated between the vertices.  Every surface is a scene of
its own, so that no ray starts on a mesh that it can meet again, and Embree's robust tests let no ray slip
through between two triangles: without them those on the grid lines do, and cost 5e-3 of the irradiance.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from optics.base.runtime import DrArray
from optics.exchange.mitsuba.loading import current_mitsuba, mitsuba_backend
from optics.exchange.mitsuba.mesh import LensMesh
from optics.exchange.mitsuba.surface_vertices import Jet
from optics.light.intersections import device_flux, rim_fade
from optics.light.tracing import Landing, refract
from optics.scene.receivers import Receiver
from optics.scene.sources import RayGrid, Rays
from thbcad.checks import Floats
from thbcad.splines import KnotVector

Vector = tuple[DrArray, DrArray, DrArray]


class MeshTracer:
    """Rays of one source through the meshes of a lens whose sags may change: a `RayTracer`.

    A front without sag is traced once.

    receiver : of the light.  soft_rim, fresnel : of a `LightPath`.
    """

    def __init__(
        self,
        mesh: LensMesh,
        rays: RayGrid | Rays,
        receiver: Receiver,
        soft_rim: float = 0.0,
        fresnel: bool = True,
    ) -> None:
        self._mitsuba, self._mesh, self._receiver = current_mitsuba(), mesh, receiver
        self._soft_rim, self._fresnel = soft_rim, fresnel
        self.backend = mitsuba_backend(self._mitsuba, "single")
        opaque, index = self.backend.opaque, mesh.lens.index
        self._index = {"front": opaque(1 / index), "rear": opaque(index)}
        robust = {"type": "scene", "embree_use_robust_intersections": True}
        shapes = mesh.shapes(self._mitsuba, tuple(mesh.surfaces))
        self._scenes = {
            name: self._mitsuba.load_dict(robust | {name: shape}) for name, shape in shapes.items()
        }
        self._parameters = [self._mitsuba.traverse(self._scenes[name]) for name in mesh.free]
        self._triangles = {
            name: [self._mitsuba.UInt32(np.ascontiguousarray(row)) for row in mesh.triangles(name).T]
            for name in shapes
        }
        self._flux = device_flux(self.backend, rays.flux)
        rays = rays.rays(float(mesh.surfaces["front"].jet()[0].min() - mesh.lens.thickness))
        ox, oy, oz = (self.backend.array(row) for row in rays.origin)
        dx, dy, dz = (self.backend.array(row) for row in rays.direction)
        self._origin, self._direction = (ox, oy, oz), (dx, dy, dz)
        self._behind = None if "front" in mesh.free else self._through_front({})
        self.backend.dr.eval(self._behind)

    def trace(self, coefficients: Sequence[Floats]) -> tuple[list[Jet], Landing]:
        """Return (leaves, Landing), differentiable in the leaves.

        These are heights and slopes at the vertices of every surface that carries a sag, front first.
        """
        leaves = self._mesh.leaves(self._mitsuba, coefficients)
        for parameters in self._parameters:
            self._mesh.follow(self._mitsuba, parameters, leaves)
        return leaves, self._landing(dict(zip(self._mesh.free, leaves)))

    def _landing(self, jets: dict[str, Jet]) -> Landing:
        """Return the Landing of the meshes as they are.  jets : of the free surfaces."""
        dr = self.backend.dr
        origin, direction, entering, _ = self._behind or self._through_front(jets)
        point, (dx, dy, dz), flux, hit = self._through("rear", jets, origin, direction, entering)
        forward = dz > 0
        dz = dr.select(forward, dz, 1)
        landed = self._receiver.land(point, (dx, dy, dz), dr, self.backend.opaque)
        return Landing(
            x=landed.u,
            y=landed.v,
            p=landed.p,
            q=landed.q,
            flux=dr.select(hit & forward, flux, 0),
            definite=hit & forward,
        )

    def pull_back(
        self, leaves: Sequence[Jet], knots: Sequence[Sequence[KnotVector]] | None = None
    ) -> list[Floats]:
        """Return the derivative by each sag's coefficients after `dr.backward`; the leaves then carry none.

        knots : of each sag, two knot vectors; the derivative is then that by a net over these knots.
        """
        slopes = self._mesh.pull_back(leaves, knots)
        self.backend.dr.clear_grad(leaves)
        return slopes

    def set_directions(self, leaves: Sequence[Jet], directions: Sequence[Floats]) -> list[DrArray]:
        """Set the derivatives of the leaves to those along a direction in the coefficients; return them."""
        return self._mesh.set_directions(self._mitsuba, leaves, directions)

    def _through_front(self, jets: dict[str, Jet]) -> tuple[Vector, Vector, DrArray, DrArray]:
        return self._through("front", jets, self._origin, self._direction, self._flux)

    def _through(
        self, name: str, jets: dict[str, Jet], origin: Vector, direction: Vector, flux: DrArray
    ) -> tuple[Vector, Vector, DrArray, DrArray]:
        """Return (meeting point, refracted direction, flux, met).

        flux : zero for rays that do not pass.  met : the mask of rays that meet the surface.
        """
        dr = self.backend.dr
        point, normal, hit = self._meeting(name, jets, origin, direction, flux > 0)
        zx, zy = (dr.select(hit, -a / normal.z, 0) for a in (normal.x, normal.y))
        refracted, transmittance, passes = refract(dr, direction, (zx, zy), self._index[name])
        x, y, z = (dr.select(hit, a, 0) for a in point)
        passing = flux * (transmittance if self._fresnel else dr.select(passes, self.backend.Float(1), 0))
        moves = name in self._mesh.free or name == "rear"  # a fixed rear lies behind a free front
        if self._soft_rim and moves:
            outline = self._mesh.surfaces[name].surface.outline
            passing = passing * rim_fade(self.backend, (x, y), outline, self._soft_rim)
        return (x, y, z), refracted, dr.select(hit, passing, 0), hit

    def _meeting(
        self, name: str, jets: dict[str, Jet], origin: Vector, direction: Vector, active: DrArray
    ) -> tuple[Any, Any, DrArray]:
        """Return (point, normal, met) of rays at a mesh, differentiable in rays and vertices.

        Mitsuba finds the triangle p q r.  With e = q - p, f = r - p and the ray o + t d, in its plane

            (u, v) = ((o - p) . (d x f), d . ((o - p) x e)) / (e . (d x f))

        gives the point p + u e + v f and the normal between those of the corners.

        Source: T. Moeller, B. Trumbore, Fast, minimum storage ray-triangle intersection, J. Graphics Tools 2
        (1997).
        """
        mi, dr = self._mitsuba, self.backend.dr
        o, d = mi.Point3f(*origin), mi.Vector3f(*direction)
        ray = dr.detach(mi.Ray3f(o, d))
        met = self._scenes[name].ray_intersect_preliminary(ray, coherent=True, active=active)
        hit, triangle = met.is_valid(), met.prim_index
        # derivatives must not look for the triangles again: the mesh may have moved on by then
        dr.eval(hit, triangle)
        positions, normals = self._mesh.vertices(mi, name, jets.get(name))
        corners = [dr.gather(mi.UInt32, row, triangle, hit) for row in self._triangles[name]]
        p, q, r = (dr.gather(mi.Point3f, positions, corner, hit) for corner in corners)
        e, f, s = q - p, r - p, o - p
        across, turned = dr.cross(d, f), dr.cross(s, e)
        scale = 1 / dr.select(hit, dr.dot(e, across), 1)
        u, v = dr.dot(s, across) * scale, dr.dot(d, turned) * scale
        n, along_e, along_f = (dr.gather(mi.Normal3f, normals, corner, hit) for corner in corners)
        return p + u * e + v * f, n * (1 - u - v) + along_e * u + along_f * v, hit
