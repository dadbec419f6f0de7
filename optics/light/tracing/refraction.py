"""Refraction and reflection at a smooth face: directions, and what Fresnel's equations let go on."""

from __future__ import annotations

from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike

from optics.base.runtime import Backend, DrArray
from optics.light.intersections import Vector
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
