"""Rays through the faces of a STEP file by OCCT's intersections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.exchange.verification.reference_tracer import last_step
from optics.light.tracing import LandingPoints
from optics.scene.receivers import Receiver
from thbcad.cad.exchange import face_hits

if TYPE_CHECKING:
    from thbcad.cad.exchange import TopoDS_Shape

Rows = NDArray[np.float64]


def occt_trace(
    solid: TopoDS_Shape,
    optical: tuple[int, int],
    origins: Rows,
    directions: Rows,
    index: float | None,
    target: Receiver,
) -> LandingPoints:
    """Trace rays of 1 W through the front and the rear of a solid, by OCCT's intersections.

    index : None is a mirror, whose front reflects all.

    optical : indices of front and rear among the faces.
    origins, directions : (n, 3) float, mm and unit vectors.
    """
    landing, flux = np.full((len(origins), 2), np.nan), np.zeros(len(origins))
    points, onward = origins, directions
    lit, weight = np.arange(len(origins)), np.ones(len(origins))
    for face, eta in zip(optical, (None,) if index is None else (1 / index, index)):
        hits = face_hits(solid, points, onward)
        if eta is None:
            across = np.einsum("ij,ij->i", onward, hits.normals)
            onward, transmittance = onward - 2 * across[:, None] * hits.normals, np.ones(len(onward))
        else:
            onward, transmittance = _refracted(onward, hits.normals, eta)
            transmittance = np.where(onward[:, 2] > 0, transmittance, 0.0)
        passes = (hits.faces == face) & (transmittance > 0)
        points, onward, lit = hits.points[passes], onward[passes], lit[passes]
        weight = weight[passes] * transmittance[passes]
    ends, meets, _ = last_step(points, onward, target)
    landing[lit[meets]], flux[lit[meets]] = ends[meets], weight[meets]
    return LandingPoints(landing, flux)


def _refracted(directions: Rows, normals: Rows, eta: float) -> tuple[Rows, Rows]:
    """Return (directions, transmittance) by Snell's law and Fresnel's equations, 0 where totally reflected.

    With the cosines a and b of the angles to the normal before and behind the face,
    T = 1 - (r_s^2 + r_p^2) / 2, r_s = (eta a - b) / (eta a + b), r_p = (a - eta b) / (a + eta b).

    eta : index before / index behind.  normals : to either side.
    """
    cosine = np.einsum("ij,ij->i", directions, normals)
    normals, before = normals * np.sign(cosine)[:, None], np.abs(cosine)
    square = 1 - eta**2 * (1 - before**2)
    passes = square > 0
    behind = np.sqrt(np.where(passes, square, 1.0))
    onward = eta * directions + (behind - eta * before)[:, None] * normals
    r_s = (eta * before - behind) / (eta * before + behind)
    r_p = (before - eta * behind) / (before + eta * behind)
    return onward, np.where(passes, 1 - (r_s**2 + r_p**2) / 2, 0.0)
