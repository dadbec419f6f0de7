"""Refraction: Snell's law and Fresnel's transmittance on Dr.Jit arrays."""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from optics.runtime import DrArray


def refract(
    dr: ModuleType, direction: tuple[DrArray, DrArray, DrArray], slope: tuple[DrArray, DrArray], eta: DrArray
) -> tuple[tuple[DrArray, DrArray, DrArray], DrArray, DrArray]:
    """Refract unit directions at the graph z(x, y), going to +z.

    direction : (dx, dy, dz).  slope : (zx, zy); the normal is (-zx, -zy, 1) / N.
    eta : index before / index behind.

    Returns
    -------
    (dx, dy, dz) unit direction, transmittance for unpolarised light (T = 1 - R), and the mask
    of rays that pass (False is total internal reflection or a surface met from behind).
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
    # 1 - R in products: small shares keep their digits; where nothing passes no denominator may vanish
    cos_i = dr.select(passes, cos_i, 1)
    senkrecht, parallel = eta * cos_i + cos_t, cos_i + eta * cos_t
    transmittance = 2 * eta * cos_i * cos_t * (1 / (senkrecht * senkrecht) + 1 / (parallel * parallel))
    return refracted, dr.select(passes, transmittance, 0), passes
