"""The optical faces of a STEP file as meshes that Mitsuba traces.

OCCT evaluates points and normals of the faces at their knots and at equal steps between. Mitsuba finds where
rays meet the triangles, interpolates the normals, and gives Fresnel's amplitudes and Snell's direction. The
order front, rear, target is ours, and so are the planes of incidence in which the polarisation is carried.
Positions err by h^2 / 8 of the curvature and slopes by h^2 / 8 of their second derivative, with the spacing h
of the nodes. Every second node makes a mesh whose landing points are farther off by three errors of the first
one (root mean square, nearly: linear interpolation between every second of equal steps differs from that
between all by sqrt(10) times its error there).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil
from typing import Any

import numpy as np

from optics.exchange.mitsuba import current_mitsuba, mitsuba_backend
from optics.exchange.verification import StepFile, last_step, optical_faces, optical_form
from optics.light.intersections import gauge
from optics.light.tracing import LandingPoints
from optics.scene.receivers import Receiver
from optics.scene.sources import Rays
from thbcad.cad.exchange import FaceNodes, face_nodes
from thbcad.checks import Floats
from thbcad.lens import OpticalForm
from thbcad.outlines import Outline
from thbcad.sags import PlacedConic
from thbcad.splines import BSplineSurface, KnotVector

FLAT = 2  # steps across a plane face
COARSER = 3.0  # errors of a mesh, from it to the mesh of every second node


def optical_nodes(file: StepFile, least: int, half_widths: Sequence[tuple[float, float]]) -> list[FaceNodes]:
    """Return the nodes of front and rear in a STEP file, at least `least` in each direction of faces that are
    not plane.

    half_widths : of front and rear, mm, for conics that the file bounds by no rectangle.
    """
    faces = []
    for number, half_width in zip(optical_faces(file.text), half_widths):
        form = optical_form(file.text, file.text.faces[number])
        if form is None:
            raise ValueError(f"face {number} of the file is neither a B-spline nor a conic around z")
        if isinstance(form, PlacedConic) and not np.isfinite(form.half_width).all():
            form = replace(form, half_width=half_width)
        faces.append(face_nodes(file.solid.shape, number, *_parameters(form, least)))
    return faces


def coarser(nodes: FaceNodes) -> FaceNodes:
    """Return every second node."""
    return FaceNodes(nodes.points[::2, ::2], nodes.normals[::2, ::2])


def _parameters(form: OpticalForm, least: int) -> tuple[Floats, Floats]:
    """Return parameters in u and in v; of a conic pairs of them at equal steps in x and y, (n, m) both."""
    if isinstance(form, BSplineSurface):
        plane = np.ptp(form.coefficients[..., 2]) == 0
        u, v = (_steps(kv, FLAT if plane else least - 1) for kv in (form.kv_u, form.kv_v))
        return u, v
    steps = FLAT if form.kind == "PLANE" else 2 * ceil((least - 1) / 2)
    x, y = np.meshgrid(*(np.linspace(-h, h, steps + 1) for h in form.half_width), indexing="ij")
    points = np.stack([x, y, form(x, y) + 0 * x], axis=-1)
    u, v = form.parameters(points.reshape(-1, 3)).T.reshape(2, *x.shape)
    return u, v


def _steps(kv: KnotVector, steps: int) -> Floats:
    """Return the knots and the same even number of equal steps in every span, at least `steps` in all."""
    breaks = kv.breaks
    each = 2 * ceil(steps / (2 * (len(breaks) - 1)))
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * (np.arange(each) / each)
    return np.append(inner.ravel(), breaks[-1])


class MeshedLens:
    """Rays through the meshes of a STEP file by Mitsuba, in single precision.

    nodes : of front and rear.  index : of the lens.  target : where the light is received.
    outlines : of front and rear; the meshes hold their rectangles.
    """

    def __init__(
        self, nodes: Sequence[FaceNodes], index: float, target: Receiver, outlines: Sequence[Outline]
    ) -> None:
        self._mitsuba, self._target = current_mitsuba(), target
        self._backend = mitsuba_backend(self._mitsuba, "single")
        self._index = self._backend.opaque(index)
        self._outlines = outlines
        self._scenes = [_scene(self._mitsuba, face) for face in nodes]

    def __call__(self, rays: Rays) -> LandingPoints:
        """Return where rays land, with the light that both faces let through."""
        mi, dr, array = self._mitsuba, self._backend.dr, self._backend.array
        point = mi.Point3f(*map(array, rays.origin))
        onward = mi.Vector3f(*map(array, rays.direction))
        flux, across = array(rays.flux), mi.coordinate_system(onward)[0]
        fields = [across, dr.cross(onward, across)]  # of unpolarised light, of strength 1
        for scene, outline, outside in zip(self._scenes, self._outlines, (True, False)):
            met = scene.ray_intersect(
                mi.Ray3f(point, onward), mi.RayFlags.All, coherent=False, active=flux > 0
            )
            normal = met.sh_frame.n
            cosine = -dr.dot(onward, normal)
            r_s, r_p, behind, _, ratio = mi.fresnel_polarized(cosine, self._index)
            # of a total reflection Mitsuba gives the cosine 0 behind the face
            passes = met.is_valid() & (behind != 0) & (cosine > 0 if outside else cosine < 0)
            ahead = mi.refract(-onward, normal, behind, ratio.real)
            fields = self._behind(fields, (onward, ahead), normal, (r_s, r_p))
            strength = dr.select(passes, sum(map(dr.squared_norm, fields)) / 2, 0)
            fields = [field * dr.rsqrt(dr.select(strength > 0, strength, 1)) for field in fields]
            if not outline.is_rectangle:
                passes &= gauge(self._backend, outline, met.p.x, met.p.y) <= 1
            flux = dr.select(passes, flux * strength, 0)
            point, onward = met.p, ahead
        every = (*(getattr(v, axis) for v in (point, onward) for axis in "xyz"), flux)
        dr.eval(every)
        *ends, weight = (a.numpy().astype(np.float64) for a in every)
        landing, meets, _ = last_step(np.stack(ends[:3], axis=1), np.stack(ends[3:], axis=1), self._target)
        arrives = (weight > 0) & (ends[5] > 0) & meets
        return LandingPoints(np.where(arrives[:, None], landing, np.nan), np.where(arrives, weight, 0.0))

    def _behind(
        self, fields: Sequence[Any], onward: tuple[Any, Any], normal: Any, reflected: tuple[Any, Any]
    ) -> list[Any]:
        """Return fields behind a face, whose squares are powers.

        onward : directions before and behind it.  reflected : amplitudes across the plane of incidence and in
            it.
        """
        dr, (before, behind) = self._backend.dr, onward
        plane = dr.cross(before, normal)
        s = dr.select(dr.any(plane != 0), dr.normalize(plane), self._mitsuba.coordinate_system(before)[0])
        t_s, t_p = (dr.sqrt(dr.maximum(1 - dr.squared_norm(r), 0)) for r in reflected)
        p, q = dr.cross(before, s), dr.cross(behind, s)
        return [t_s * dr.dot(field, s) * s + t_p * dr.dot(field, p) * q for field in fields]


def _scene(mitsuba: Any, nodes: FaceNodes) -> Any:
    """Return a scene with one face; Embree's robust tests let no ray slip between two triangles."""
    rows, columns, _ = nodes.points.shape
    grid = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    a, b, c, d = (g.ravel() for g in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    mesh = mitsuba.Mesh("face", rows * columns, len(triangles), has_vertex_normals=True)
    parameters = mitsuba.traverse(mesh)
    parameters["faces"] = triangles.ravel()
    parameters["vertex_positions"] = nodes.points.astype(np.float32).ravel()
    parameters["vertex_normals"] = nodes.normals.astype(np.float32).ravel()
    parameters.update()
    return mitsuba.load_dict({"type": "scene", "embree_use_robust_intersections": True, "face": mesh})
