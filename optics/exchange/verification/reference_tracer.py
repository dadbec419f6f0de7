"""An independent tracer: numpy and scipy on the poles and knots of a STEP file.

It shares no code with the optimiser's tracer: surfaces are general parametric splines evaluated
by scipy's NdBSpline, rays are intersected by Newton's method in the surface parameters, with planes and
conics in closed form, and refraction uses the vector form of Snell's law.  Polarisation is carried as the
electric fields of two parts of the light.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from optics.base.runtime import NumericalError
from optics.exchange.verification.rays_behind import Fields, RaysBehind, across_to, inside, passes
from optics.exchange.verification.traced_faces import MEETS, ConicFace, FaceRim, Meetings, ParametricFace, dot
from optics.light.tracing import LandingPoints
from optics.scene.paths import AIR, LightPath, Stop
from optics.scene.problem import FaceMet
from optics.scene.receivers import Receiver
from optics.scene.system import TURNED
from thbcad.checks import Bools, Floats
from thbcad.lens import OpticalForm
from thbcad.outlines import Outline
from thbcad.poses import IDENTITY, Pose
from thbcad.sags import Conic, PlacedConic, graph_poles
from thbcad.splines import BSplineSurface, KnotVector

NEWTON_STEPS, NEWTON_TOLERANCE = 20, 1e-12
AT_ONCE = 20_000  # rays


class OpticalFaces(Protocol):
    """Front and rear of a STEP file, as `SolidFile` has them, mm."""

    @property
    def front(self) -> OpticalForm: ...

    @property
    def rear(self) -> OpticalForm: ...


@dataclass(frozen=True, eq=False)
class FileFace:
    """A face as light meets it, from its -z.

    form : of a file, or of the prescription of a fixed surface.
    eta : index before / index behind it, also where it reflects by Fresnel's equations; None reflects all.
    share : of the light that goes on where there is a coating, or a metal.
    opening : what is open of it; None is all.  rim : where the face does not fill its rectangle.
    pose : from its frame to that of the rays.  in_air : light comes to it through air, where stops are.
    """

    form: OpticalForm
    eta: float | None
    reflects: bool = False
    share: float | None = None
    opening: Outline | None = None
    rim: FaceRim | None = None
    pose: Pose = IDENTITY
    in_air: bool = True


def fixed_face(path: LightPath, number: int) -> FileFace:
    """Return a surface of a path as its prescription, and its sag, have it."""
    surface, (before, behind) = path.surfaces[number], path.media[number : number + 2]
    mirror = surface.kind == "reflect"
    eta = before.index / (surface.beyond if mirror else behind).index
    shape, form = surface.shape, PlacedConic(surface.shape.conic, 0.0, surface.shape.half_width)
    if shape.sag is not None:
        graph = shape.graph((shape.sag.space.kv_u.degree, shape.sag.space.kv_v.degree))
    return FileFace(
        form if shape.sag is None else graph_poles(graph, 0.0, graph),
        None if mirror and surface.share is not None else eta,
        mirror,
        surface.share,
        surface.open,
        pose=surface.pose,
        in_air=before == AIR,
    )


def through_faces(faces: Sequence[FileFace], rays: RaysBehind, stops: Sequence[Stop] = ()) -> RaysBehind:
    """Trace rays over faces, one after the other.  stops : in the frame of the rays."""
    points, directions, weight, fields = rays.points, rays.directions, rays.flux.copy(), rays.polarised
    for face in faces:
        back = face.pose.inverse()
        start, onward = points, directions
        own, along = back.points(points.T).T, back.directions(directions.T).T
        own, normals, met = _meet(face.form, own, along)
        if face.rim is not None:
            met = met & face.rim.holds(own[:, :2])
        if face.opening is not None:
            met &= inside(face.opening, own[:, 0], own[:, 1])
        points = face.pose.points(own.T).T
        if stops and face.in_air:
            met &= passes(stops, start, onward, np.where(met, dot(points - start, onward), np.inf))
        if face.reflects:
            along = along - 2 * dot(along, normals)[:, None] * normals
        else:
            assert face.eta is not None
            along, refracts = refract(along, normals, face.eta)
            met &= refracts & (along[:, 2] > 0)
        directions = face.pose.directions(along.T).T
        normals = face.pose.directions(normals.T).T
        passing, fields = _polarised(fields, onward, directions, normals, face)
        weight *= np.where(met, passing, 0.0)
    return RaysBehind(points, directions, weight, fields)


def trace_step(
    step: OpticalFaces,
    origins: Floats,
    directions: Floats,
    flux: ArrayLike,
    index: float | None,
    target: Receiver,
) -> LandingPoints:
    """Trace rays through the two faces of a STEP file to a target, or by its front, which reflects.

    origins, directions : (n, 3) float, mm and unit vectors.  flux : (n,) or float, W before the lens.
    index : None is a mirror.
    """
    faces = [FileFace(step.front, None, reflects=True)]
    if index is not None:
        faces = [FileFace(step.front, 1 / index), FileFace(step.rear, index)]
    weight = np.broadcast_to(np.asarray(flux, dtype=float), len(origins))
    return through_faces(faces, RaysBehind(origins, directions, weight)).landing(target)


def lens_faces(
    step: OpticalFaces, path: LightPath, met: Mapping[int, FaceMet], rims: Sequence[FaceRim] = ()
) -> list[FileFace]:
    """Return the faces of a STEP file as light meets them.

    path : in the frame of the file.  met : its faces, by their number along the path.
    rims : of front and rear, where the faces do not fill their rectangles.
    """
    faces = []
    for k, face in met.items():
        rear, plain = face.face == "rear", fixed_face(path, k)
        form = step.rear if rear else step.front
        form, pose = (_turned(form), TURNED) if face.backwards else (form, IDENTITY)
        rim, opening = rims[rear] if rims else None, path.surfaces[k].clear
        faces.append(replace(plain, form=form, opening=opening, rim=rim, pose=pose))
    return faces


def _turned(form: OpticalForm) -> OpticalForm:
    """Return a form in a frame that is turned half round about x."""
    if isinstance(form, PlacedConic):
        conic = Conic(-form.conic.radius, form.conic.constant)
        return PlacedConic(conic, -form.vertex, form.half_width)
    start, stop = form.kv_v.start, form.kv_v.stop
    kv = KnotVector(form.kv_v.degree, start + stop - form.kv_v.knots[::-1])
    return BSplineSurface(form.kv_u, kv, form.coefficients[:, ::-1] * (1.0, -1.0, -1.0))


def _meet(surface: OpticalForm, points: Floats, directions: Floats) -> Meetings:
    """Return (points, unit normals towards +z, met) of rays on a face."""
    if isinstance(surface, PlacedConic):
        return ConicFace(surface).intersect(points, directions)
    return _intersect(ParametricFace(surface), points, directions)


def _intersect(face: ParametricFace, points: Floats, directions: Floats) -> Meetings:
    """Return (points, unit normals towards +z, met) of rays on a spline, part by part."""
    parts = [slice(k, k + AT_ONCE) for k in range(0, len(points), AT_ONCE)]
    meetings = [_newton(face, points[k], directions[k], face.start(points[k], directions[k])) for k in parts]
    on_face, normals, met = (np.concatenate(column) for column in zip(*meetings))
    return on_face, normals, met & ~face.behind(points, directions)


def _newton(face: ParametricFace, points: Floats, directions: Floats, uv: Floats) -> Meetings:
    """Return (points, unit normals towards +z, met) by Newton's method from the parameters uv.

    It solves a . (S - o) = b . (S - o) = 0 with a, b perpendicular to the ray.  Meetings behind the origin or
    on the far side of the face do not count.
    """
    helper = np.where(np.abs(directions[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    a = np.cross(directions, helper)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(directions, a)
    size = np.abs(face.high - face.low).max()
    for _ in range(NEWTON_STEPS):
        s, su, sv = face.jet(uv)
        f, g = dot(a, s - points), dot(b, s - points)
        fu, fv, gu, gv = dot(a, su), dot(a, sv), dot(b, su), dot(b, sv)
        determinant = fu * gv - fv * gu
        step = np.column_stack([gv * f - fv * g, fu * g - gu * f]) / determinant[:, None]
        uv = np.clip(uv - step, face.low, face.high)
        if np.abs(step).max(initial=0.0) < NEWTON_TOLERANCE * size:
            break
    s, su, sv = face.jet(uv)
    distance = np.hypot(dot(a, s - points), dot(b, s - points))
    normals = np.cross(su, sv)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals *= np.sign(normals[:, 2:])
    if not np.isfinite(s).all():
        raise NumericalError("the independent trace met a degenerate face")
    near = MEETS * face.width
    met = (distance < near) & (dot(s - points, directions) >= -near) & (dot(normals, directions) > 0)
    return s, normals, met


def refract(directions: Floats, normals: Floats, eta: float) -> tuple[Floats, Bools]:
    """Return (directions, which rays refract) by the vector form of Snell's law.

    Rays do not where light is totally reflected, and where the normals do not point along them.

    eta : index before / index behind.
    """
    cos_i = dot(directions, normals)
    square = 1 - eta**2 * (1 - cos_i**2)
    passes = (square > 0) & (cos_i > 0)
    cos_t = np.sqrt(np.where(passes, square, 1.0))
    return eta * directions + (cos_t - eta * cos_i)[:, None] * normals, passes


def _polarised(
    fields: Fields, before: Floats, behind: Floats, normals: Floats, face: FileFace
) -> tuple[Floats, Fields]:
    """Return (the share of the light that goes on, its fields).

    before, behind : directions, (n, 3).  normals : along them.
    """
    plane, across = np.cross(before, normals), across_to(before)
    size = np.linalg.norm(plane, axis=1, keepdims=True)
    s = np.where(size > 0, plane / np.where(size > 0, size, 1.0), across)
    of_s, of_p, power = _amplitudes(face, dot(before, normals))
    along_s, along_p = (np.einsum("nkj,nj->nk", fields, axis) for axis in (s, np.cross(before, s)))
    s_part = (of_s[:, None] * along_s)[:, :, None] * s[:, None]
    onward = s_part + (of_p[:, None] * along_p)[:, :, None] * np.cross(behind, s)[:, None]
    strength = (np.abs(onward) ** 2).sum(axis=(1, 2)) / 2
    return power * strength, onward / np.sqrt(np.where(strength > 0, strength, 1.0))[:, None, None]


def _amplitudes(face: FileFace, cosine: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the amplitudes of fields across the plane of incidence and in it, and the power of their square.

    With the cosines a and b of the angles to the normal before and behind the face, light that is refracted
    has the amplitudes 2 eta a / (eta a + b) and 2 eta a / (a + eta b), and b / (eta a) times their squares as
    power.  Light that is reflected has (eta a - b) / (eta a + b) and (a - eta b) / (a + eta b), complex where
    all of it is.  A coating has the same share of both, and a mirror turns one of them round.
    """
    one = np.ones(len(cosine))
    if face.share is not None or face.eta is None:
        return -one if face.reflects else one, one, one * (1.0 if face.share is None else face.share)
    eta, a = face.eta, cosine
    square = 1 - eta**2 * (1 - a**2)
    if not face.reflects:
        b = np.sqrt(np.maximum(square, 0.0))
        return 2 * eta * a / (eta * a + b), 2 * eta * a / (a + eta * b), b / (eta * a)
    b = np.sqrt(square + 0j if eta > 1 else square)
    return (eta * a - b) / (eta * a + b), (a - eta * b) / (a + eta * b), one
