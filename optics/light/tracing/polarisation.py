"""Polarisation of light from face to face: Stokes parameters and the Mueller matrices of smooth faces.

Light leaves its source unpolarised.  A face at oblique incidence lets more of the light through that swings
in the plane of incidence (p) than of the light that swings across it (s).  In a frame along s and p a face
takes the Stokes vector (I, Q, U, V) to

    I' = mean I + half Q,    Q' = half I + mean Q,    U' = even U - odd V,    V' = odd U + even V.

The next face has another plane of incidence.  For the angle a from one s to the next,

    Q cos 2a + U sin 2a,    U cos 2a - Q sin 2a

are the parameters there.  The first oblique face sends on the mean of s and p, which is all that the light
of one such face needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import NamedTuple

from optics.base.runtime import DrArray
from optics.light.intersections import Stokes, Vector
from optics.scene.paths import Surface


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


def polarising(surfaces: Sequence[Surface], along_axis: bool) -> range:
    """Return the numbers of the surfaces behind which the polarisation matters: from the first that tells s
    from p to the last but one.

    along_axis : all rays come along z of the first surface's frame.
    """
    faces = [k for k, surface in enumerate(surfaces) if surface.share is None]
    if along_axis and faces[:1] == [0] and surfaces[0].is_flat:
        faces = faces[1:]
    return range(faces[0], faces[-1]) if faces else range(0)


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
