"""What Fresnel's equations let through a smooth face between two media, and through a lens at most."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from optics.tracing.refraction import refract

if TYPE_CHECKING:
    from optics.runtime import Backend

    Array = NDArray[np.float64]

ANGLES = 9001  # at which the best transmittance is sought


def transmittances(before: float, behind: float, angle: ArrayLike) -> tuple[Array, Array]:
    """Return the shares of power that pass in s- and in p-polarised light, each (n,).

    T_s = 1 - |(n_i cos_i - n_t cos_t) / (n_i cos_i + n_t cos_t)|^2 and
    T_p = 1 - |(n_t cos_i - n_i cos_t) / (n_t cos_i + n_i cos_t)|^2, 0 beyond the critical angle (thesis
    2.6-2.10).

    before, behind : indices n_i and n_t.  angle : of incidence, (n,) radians, from 0 to below pi / 2.
    """
    cos_i = np.cos(np.atleast_1d(angle)).astype(complex)
    cos_t = np.sqrt(
        1 - (before / behind) ** 2 * (1 - cos_i**2)
    )  # imaginary beyond the critical angle: then |r| = 1
    senkrecht = (before * cos_i - behind * cos_t) / (before * cos_i + behind * cos_t)
    parallel = (behind * cos_i - before * cos_t) / (behind * cos_i + before * cos_t)
    return 1 - np.abs(senkrecht) ** 2, 1 - np.abs(parallel) ** 2


def traced_transmittance(backend: Backend, before: float, behind: float, angle: ArrayLike) -> Array:
    """Return the share of unpolarised light that passes, T_u = (T_s + T_p) / 2, as the tracer takes it, (n,).

    before, behind : indices.  angle : of incidence, (n,) radians.
    """
    sine, cosine = (backend.array(f(np.atleast_1d(angle))) for f in (np.sin, np.cos))
    _, share, _ = refract(
        backend.dr,
        (sine, backend.Float(0), cosine),
        (backend.Float(0), backend.Float(0)),
        backend.Float(before / behind),
    )
    return share.numpy().astype(np.float64)


def critical_angle(before: float, behind: float) -> float | None:
    """Return the angle of incidence, radians, beyond which all light is reflected, sin = n_t / n_i; None
    where there is none."""
    return float(np.arcsin(behind / before)) if behind < before else None


def efficiency_bound(index: float) -> float:
    """Return the most unpolarised light that two uncoated faces let through, max T_u^2 over the angle: 0.96^2
    for n = 1.5 (thesis 2.13).

    It is that of normal incidence, (1 - ((n - 1) / (n + 1))^2)^2, for n up to 3.7; above, oblique light
    passes a little better.
    """
    senkrecht, parallel = transmittances(1.0, index, np.linspace(0, np.pi / 2, ANGLES))
    return float(((senkrecht + parallel) / 2).max() ** 2)
