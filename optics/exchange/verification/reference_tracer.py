"""An independent tracer: numpy and scipy on the poles and knots of a STEP file.

It shares no code with the optimiser's tracer: surfaces are general parametric splines evaluated
by scipy's NdBSpline, rays are intersected by Newton's method in the surface parameters, with planes and
conics in closed form, and refraction uses the vector form of Snell's law.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from optics.base.runtime import NumericalError
from optics.exchange.verification.traced_faces import (
    MEETS,
    ConicFace,
    FaceRim,
    Floats,
    Meetings,
    ParametricFace,
    dot,
)
from optics.light.tracing import LandingPoints
from optics.scene.paths import LightPath, Stop
from optics.scene.receivers import Cylinder, Receiver, Sphere
from thbcad.lens import OpticalForm
from thbcad.outlines import Outline
from thbcad.sags import PlacedConic

Booleans = NDArray[np.bool_]

NEWTON_STEPS, NEWTON_TOLERANCE = 20, 1e-12
AT_ONCE = 20_000  # rays


class OpticalFaces(Protocol):
    """Front and rear of a STEP file, as `SolidFile` has them, mm."""

    @property
    def front(self) -> OpticalForm: ...

    @property
    def rear(self) -> OpticalForm: ...


def trace_step(
    step: OpticalFaces,
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
    flux: ArrayLike,
    index: float | None,
    target: Receiver,
    around: LightPath | None = None,
    rims: Sequence[FaceRim] = (),
) -> LandingPoints:
    """Trace rays through the two faces of a STEP file to a target, or by its front, which reflects.

    origins, directions : (n, 3) float, mm and unit vectors.  flux : (n,) or float, W before the lens.
    index : None is a mirror.
    around : the path whose stops and clear apertures block light, and whose coatings take a share of it, in
        the frame of the file; None is nothing.
    rims : of front and rear, where the faces do not fill their rectangles.
    Far-field points are the angles atan(d_x / d_z), atan(d_y / d_z) in degrees.
    """
    points = origins
    weight = np.broadcast_to(np.asarray(flux, dtype=float), len(origins)).copy()
    stops, openings, shares = (
        ((), (None, None), (None, None))
        if around is None
        else (around.stops, [s.clear for s in around.surfaces], [s.share for s in around.surfaces])
    )
    faces = [(step.front, None)] if index is None else [(step.front, 1 / index), (step.rear, index)]
    for k, (surface, eta) in enumerate(faces):
        start, onward = points, directions
        points, normals, met = _meet(surface, points, directions)
        if rims:
            met = met & rims[k].holds(points[:, :2])
        opening = openings[k]
        if opening is not None:
            met &= _inside(opening, points[:, 0], points[:, 1])
        if k == 0:
            met &= _passes(stops, start, onward, np.where(met, dot(points - start, onward), np.inf))
        if eta is None:
            directions = directions - 2 * dot(directions, normals)[:, None] * normals
            transmittance = np.ones(len(points))
        else:
            directions, transmittance = refract(directions, normals, eta)
            met &= directions[:, 2] > 0
        share = shares[k]
        weight *= np.where(met & (transmittance > 0), transmittance if share is None else share, 0.0)
    landing, meets, length = last_step(points, directions, target)
    arrives = (weight > 0) & meets & _passes(stops, points, directions, length)
    return LandingPoints(np.where(arrives[:, None], landing, np.nan), np.where(arrives, weight, 0.0))


def last_step(points: Floats, directions: Floats, target: Receiver) -> tuple[Floats, Booleans, Floats]:
    """Return where rays land, (n, 2), mm or degrees, whether they meet the target from before it, (n,), and
    how far they go, (n,) mm; inf where they do not, and to the far field.

    points, directions : (n, 3), in the frame of the lens.
    """
    own, along = (points - target.pose.shift) @ target.pose.rotation, directions @ target.pose.rotation
    meets = along[:, 2] > 0
    if isinstance(target, Cylinder):
        landing, length, round_it = _round(own, along, target.radius, isinstance(target, Sphere))
        meets &= round_it
        return landing, meets, np.where(meets, length, np.inf)
    across = along[:, :2] / np.where(meets, along[:, 2], 1.0)[:, None]
    if target.far_field:
        return np.degrees(np.arctan(across)), meets, np.full(len(points), np.inf)
    length = np.where(meets, -own[:, 2] / np.where(meets, along[:, 2], 1.0), np.inf)
    return own[:, :2] - own[:, 2:] * across, meets, length


def _round(
    points: Floats, directions: Floats, radius: float, sphere: bool
) -> tuple[Floats, Floats, Booleans]:
    """Return (arcs, lengths, met) of rays on the half of a cylinder or a sphere about (0, 0, radius).

    From its centre it is |p + t d| = |R| without y round a cylinder: the nearer root where R > 0.
    """
    centred = points - (0.0, 0.0, radius)
    some = [0, 1, 2] if sphere else [0, 2]
    p, d = centred[:, some], directions[:, some]
    a, b, c = dot(d, d), dot(p, d), dot(p, p) - radius**2
    met = b * b > a * c
    length = (-b - np.sign(radius) * np.sqrt(np.where(met, b * b - a * c, 1.0))) / a
    x, y, z = (centred + length[:, None] * directions).T / radius
    up = radius * np.arcsin(np.clip(y, -1, 1)) if sphere else radius * y
    return np.column_stack([radius * np.arctan2(x, -z), up]), length, met & (z < 0)


def _passes(stops: Sequence[Stop], points: Floats, directions: Floats, length: Floats) -> NDArray[np.bool_]:
    """Return which rays no stop takes within a length, (n,) mm."""
    passes = np.ones(len(points), dtype=bool)
    for stop in stops:
        normal = stop.pose.rotation[:, 2]
        across = directions @ normal
        crosses = across != 0
        path = (stop.pose.shift - points) @ normal / np.where(crosses, across, 1.0)
        there = (points + path[:, None] * directions - stop.pose.shift) @ stop.pose.rotation
        shape = _inside(stop.outline, there[:, 0], there[:, 1])
        if stop.inner is not None:
            shape &= ~_inside(stop.inner, there[:, 0], there[:, 1])
        passes &= ~((shape != stop.hole) & crosses & (path > 0) & (path < length))
    return passes


def _inside(outline: Outline, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Return which points lie within an outline: beyond the middles of its corners within their ellipses."""
    inside = (np.abs(x) <= outline.half_width[0]) & (np.abs(y) <= outline.half_width[1])
    if min(outline.corners) > 0:
        beyond = [
            np.maximum(np.abs(a) - (h - c), 0.0) / c
            for a, h, c in zip((x, y), outline.half_width, outline.corners)
        ]
        inside &= beyond[0] ** 2 + beyond[1] ** 2 <= 1
    return inside


def _meet(surface: OpticalForm, points: NDArray[np.float64], directions: NDArray[np.float64]) -> Meetings:
    """Return (points, unit normals towards +z, met) of rays on a face."""
    if isinstance(surface, PlacedConic):
        return ConicFace(surface).intersect(points, directions)
    return _intersect(ParametricFace(surface), points, directions)


def _intersect(
    face: ParametricFace, points: NDArray[np.float64], directions: NDArray[np.float64]
) -> Meetings:
    """Return (points, unit normals towards +z, met) of rays on a spline, part by part."""
    parts = [slice(k, k + AT_ONCE) for k in range(0, len(points), AT_ONCE)]
    meetings = [_newton(face, points[k], directions[k], face.start(points[k], directions[k])) for k in parts]
    on_face, normals, met = (np.concatenate(column) for column in zip(*meetings))
    return on_face, normals, met & ~face.behind(points, directions)


def _newton(
    face: ParametricFace,
    points: NDArray[np.float64],
    directions: NDArray[np.float64],
    uv: NDArray[np.float64],
) -> Meetings:
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


def refract(directions: Floats, normals: Floats, eta: float) -> tuple[Floats, Floats]:
    """Return (directions, transmittance) by the vector form of Snell's law and Fresnel's equations.

    T = 0 where light is totally reflected, and where the normals do not point along the rays.

    With the cosines a and b of the angles to the normal before and behind the face,
    T = 1 - (r_s^2 + r_p^2) / 2, r_s = (eta a - b) / (eta a + b), r_p = (a - eta b) / (a + eta b).

    eta : index before / index behind.
    """
    cos_i = dot(directions, normals)
    square = 1 - eta**2 * (1 - cos_i**2)
    passes = (square > 0) & (cos_i > 0)
    cos_t = np.sqrt(np.where(passes, square, 1.0))
    refracted = eta * directions + (cos_t - eta * cos_i)[:, None] * normals
    rs = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    rp = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    return refracted, np.where(passes, 1 - (rs**2 + rp**2) / 2, 0.0)
