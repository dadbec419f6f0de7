"""Refraction and reflection at a smooth face: directions, what Fresnel's equations let go on, and how that
polarises the light.

Light leaves its source unpolarised.  A face at oblique incidence lets more of the light through that swings
in the plane of incidence (p) than of the light that swings across it (s).  In a frame along s and p a face
takes the Stokes vector (I, Q, U, V) to

    I' = mean I + half Q,    Q' = half I + mean Q,    U' = even U - odd V,    V' = odd U + even V.

The next face has another plane of incidence.  For the angle a from one s to the next,

    Q cos 2a + U sin 2a,    U cos 2a - Q sin 2a

are the parameters there.  The first oblique face sends on the mean of s and p, so that polarisation matters
only from the second one on.
"""

from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import Stokes, Vector
from optics.scene.paths import LightPath, Surface
from optics.scene.sources import RayGrid, Rays
from thbcad.checks import Floats


def refract(
    dr: ModuleType, direction: Vector, slope: tuple[DrArray, DrArray], eta: DrArray
) -> tuple[Vector, DrArray, DrArray]:
    """Refract unit directions at the graph z(x, y), going to +z.

    direction : (dx, dy, dz).  slope : (zx, zy); the normal is (-zx, -zy, 1) / N.
    eta : index before / index behind.

    Returns (dx, dy, dz) unit direction, transmittance for unpolarised light (T = 1 - R), and the mask of rays
    that pass (False is total internal reflection or a surface met from behind).
    """
    dx, dy, dz = direction
    zx, zy = slope
    inverse = dr.rsqrt(1 + zx * zx + zy * zy)
    cos_i = (dz - dx * zx - dy * zy) * inverse
    square = 1 - eta * eta * (1 - cos_i * cos_i)
    passes = (square > 0) & (cos_i > 0)
    cos_t = dr.sqrt(dr.select(passes, square, 1))
    along = (cos_t - eta * cos_i) * inverse
    refracted = (eta * dx - along * zx, eta * dy - along * zy, eta * dz + along)
    # 1 - R in products, so that small transmittances keep their digits
    cos_i = dr.select(passes, cos_i, 1)  # where nothing passes no denominator may vanish
    s, p = eta * cos_i + cos_t, cos_i + eta * cos_t  # of s- and of p-polarised light
    transmittance = 2 * eta * cos_i * cos_t * (1 / (s * s) + 1 / (p * p))
    return refracted, dr.select(passes, transmittance, 0), passes


def reflect(
    dr: ModuleType, direction: Vector, slope: tuple[DrArray, DrArray], eta: DrArray
) -> tuple[Vector, DrArray, DrArray]:
    """Reflect unit directions at the graph z(x, y), met going to +z: d - 2 (d . n) n.

    eta : index before / index behind.  The rest is as of `refract`.

    Returns (dx, dy, dz) unit direction, reflectance for unpolarised light, 1 beyond the critical angle, and
    the mask of rays that meet the surface from before it.
    """
    dx, dy, dz = direction
    zx, zy = slope
    _, transmittance, refracts = refract(dr, direction, slope, eta)
    square = 1 + zx * zx + zy * zy
    across = dz - dx * zx - dy * zy
    twice = 2 * across / square
    reflected = (dx + twice * zx, dy + twice * zy, dz - twice)
    return reflected, dr.select(refracts, 1 - transmittance, 1), across > 0


class Mueller(NamedTuple):
    """The matrix of a face along s and p, see above; each (n,) or a number."""

    mean: DrArray
    half: DrArray
    even: DrArray
    odd: DrArray


def transmission(dr: ModuleType, cosine: DrArray, eta: DrArray) -> Mueller:
    """Return the matrix of light that bare glass refracts, 0 where it is totally reflected.

    T_s = 4 eta cos_i cos_t / (eta cos_i + cos_t)^2,  T_p = 4 eta cos_i cos_t / (cos_i + eta cos_t)^2.

    cosine : of the angle of incidence.  eta : index before / index behind.
    """
    cos_i, cos_t, passes = _cosines(dr, cosine, eta)
    s, p, both = eta * cos_i + cos_t, cos_i + eta * cos_t, 2 * eta * cos_i * cos_t
    parts = both * (1 / (s * s) + 1 / (p * p)), both * (1 / (s * s) - 1 / (p * p)), 2 * both / (s * p)
    mean, half, even = (dr.select(passes, part, 0) for part in parts)
    return Mueller(mean, half, even, 0 * mean)


def reflection(dr: ModuleType, cosine: DrArray, eta: DrArray) -> Mueller:
    """Return the matrix of light that bare glass reflects.

    r_s = (eta cos_i - cos_t) / (eta cos_i + cos_t),  r_p = (cos_i - eta cos_t) / (cos_i + eta cos_t).  Where
    all is reflected r_s r_p* = z^2 / |z|^2, z = eta sin^2_i + i cos_i sqrt(eta^2 sin^2_i - 1).

    cosine, eta : as of `transmission`.
    """
    mean, half, _, _ = transmission(dr, cosine, eta)
    cos_i, cos_t, passes = _cosines(dr, cosine, eta)
    partial = (eta * cos_i - cos_t) * (cos_i - eta * cos_t) / ((eta * cos_i + cos_t) * (cos_i + eta * cos_t))
    square = dr.select(passes, 1, 1 - cosine * cosine)
    real = eta * square
    imaginary = cosine * dr.sqrt(dr.maximum(eta * eta * square - 1, 0))
    size = _positive(dr, real * real + imaginary * imaginary)
    even = dr.select(passes, partial, (real * real - imaginary * imaginary) / size)
    odd = dr.select(passes, 0, 2 * real * imaginary / size)
    return Mueller(1 - mean, -half, even, odd)


def uniform(share: DrArray, reflects: bool) -> Mueller:
    """Return the matrix of a coating or a metal that sends on the same share of s and p.

    As with an ideal conductor, the field along s changes its sign against p in reflection.
    """
    return Mueller(share, 0.0, -share if reflects else share, 0.0)


def selected(dr: ModuleType, mask: DrArray, yes: Mueller, no: Mueller) -> Mueller:
    """Return one matrix where a mask holds, another elsewhere."""
    return Mueller(*(dr.select(mask, a, b) for a, b in zip(yes, no)))


def _cosines(dr: ModuleType, cosine: DrArray, eta: DrArray) -> tuple[DrArray, DrArray, DrArray]:
    """Return cos_i, cos_t and which rays refract; both cosines are 1 of the others."""
    square = 1 - eta * eta * (1 - cosine * cosine)
    passes = (square > 0) & (cosine > 0)
    return dr.select(passes, cosine, 1), dr.sqrt(dr.select(passes, square, 1)), passes


def at_face(
    dr: ModuleType, stokes: Stokes | None, direction: Vector, normal: Vector, face: Mueller
) -> tuple[DrArray, Stokes]:
    """Return the share of the light that goes on, and its polarisation behind the face.

    stokes : of the light that comes; None is unpolarised.
    direction : before the face.  normal : of any length, on the side to which light comes through.
    """
    plane = _cross(direction, normal)
    if stokes is None:
        return face.mean, Stokes(face.half / _positive(dr, face.mean), 0.0, 0.0, plane)
    turned = _turned(dr, stokes, direction, plane)
    q, u, v = turned.q, turned.u, turned.v
    share = dr.maximum(face.mean + face.half * q, 0)
    scale = 1 / _positive(dr, share)
    behind = face.half + face.mean * q, face.even * u - face.odd * v, face.odd * u + face.even * v
    q, u, v = (scale * part for part in behind)
    return share, Stokes(q, u, v, turned.across)


def polarising(path: LightPath, rays: RayGrid | Rays) -> range:
    """Return the numbers of the surfaces behind which the polarisation of rays matters: from the first that
    tells s from p to the last but one.

    A coating, a metal, and a plane that all rays meet along its normal do not tell s from p.
    """
    faces = [k for k, surface in enumerate(path.surfaces) if surface.share is None]
    if faces[:1] == [0] and _along_normal(path.surfaces[0], rays):
        faces = faces[1:]
    return range(faces[0], faces[-1]) if faces else range(0)


def _along_normal(surface: Surface, rays: RayGrid | Rays) -> bool:
    """Return whether all rays go along z of the frame of a plane."""
    if not surface.is_flat:
        return False
    direction = rays.direction if isinstance(rays, Rays) else np.array([[0.0], [0.0], [1.0]])
    return not surface.pose.inverse().directions(direction)[:2].any()


def _turned(dr: ModuleType, stokes: Stokes, direction: Vector, plane: Vector) -> Stokes:
    """Return the parameters in a frame along another vector; along its own where that is zero."""
    c, s = _dot(stokes.across, plane), _dot(_cross(stokes.across, plane), direction)
    size = c * c + s * s
    known, inverse = size > 0, 1 / _positive(dr, size)
    cosine = dr.select(known, (c * c - s * s) * inverse, 1)
    sine = dr.select(known, 2 * c * s * inverse, 0)
    x, y, z = (dr.select(known, b, a + b) for a, b in zip(stokes.across, plane))
    q, u = stokes.q * cosine + stokes.u * sine, stokes.u * cosine - stokes.q * sine
    return Stokes(q, u, stokes.v, (x, y, z))


def _positive(dr: ModuleType, value: DrArray) -> DrArray:
    """Return a divisor: the value where it is positive, else 1."""
    return dr.select(value > 0, value, 1)


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Vector, b: Vector) -> DrArray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def transmittances(before: float, behind: float, angle: ArrayLike) -> tuple[Floats, Floats]:
    """Return the transmittances of power for s- and for p-polarised light, each (n,).

    T_s = 1 - |(n_i cos_i - n_t cos_t) / (n_i cos_i + n_t cos_t)|^2 and
    T_p = 1 - |(n_t cos_i - n_i cos_t) / (n_t cos_i + n_i cos_t)|^2, 0 beyond the critical angle (thesis
    2.6-2.10).

    before, behind : indices n_i and n_t.  angle : of incidence, (n,) radians, from 0 to below pi / 2.
    """
    cos_i = np.cos(np.atleast_1d(angle)).astype(complex)
    # imaginary beyond the critical angle: then |r| = 1
    cos_t = np.sqrt(1 - (before / behind) ** 2 * (1 - cos_i**2))
    r_s = (before * cos_i - behind * cos_t) / (before * cos_i + behind * cos_t)
    r_p = (behind * cos_i - before * cos_t) / (behind * cos_i + before * cos_t)
    return 1 - np.abs(r_s) ** 2, 1 - np.abs(r_p) ** 2


def traced_transmittance(backend: Backend, before: float, behind: float, angle: ArrayLike) -> Floats:
    """Return the transmittance of unpolarised light as the tracer computes it, T_u = (T_s + T_p) / 2, (n,).

    before, behind : indices.  angle : of incidence, (n,) radians.
    """
    sine, cosine = (backend.array(f(np.atleast_1d(angle))) for f in (np.sin, np.cos))
    _, transmittance, _ = refract(
        backend.dr,
        (sine, backend.Float(0), cosine),
        (backend.Float(0), backend.Float(0)),
        backend.Float(before / behind),
    )
    return transmittance.numpy().astype(np.float64)


def critical_angle(before: float, behind: float) -> float | None:
    """Return the angle of incidence, radians, beyond which all light is reflected: sin = n_t / n_i.

    None where there is no such angle.
    """
    return float(np.arcsin(behind / before)) if behind < before else None


def normal_incidence_transmittance(index: float) -> float:
    """Return what one pass through two uncoated faces leaves of light at normal incidence.

    T^2 = (1 - ((n - 1) / (n + 1))^2)^2, 0.96^2 = 0.9216 for n = 1.5 (thesis 2.13).  It is no bound.  Light
    that is reflected within the lens may still arrive: a plate passes 2 n / (n^2 + 1) = 0.9231 with all its
    reflections, and from n = 3.7 on oblique faces pass more.  The only bound of a lens is 1.
    """
    return (1 - ((index - 1) / (index + 1)) ** 2) ** 2
