"""Rays through the faces of a STEP file by OCCT's intersections."""

from __future__ import annotations

from math import isinf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.tracing import LandingPoints
from thbcad.cad.exchange import face_hits
from thbcad.splines import BSplineSurface

if TYPE_CHECKING:
    from thbcad.cad.exchange import TopoDS_Shape
    from thbcad.io import Brep

    Rows = NDArray[np.float64]


def optical_faces(solid: Brep) -> tuple[int, int]:
    """Return the indices of front and rear among the faces.

    They are the two splines that are curved in both directions, the lower one first.
    """
    heights: dict[int, float] = {}
    for k, face in enumerate(solid.faces):
        surface = face.surface
        if isinstance(surface, BSplineSurface) and min(surface.kv_u.degree, surface.kv_v.degree) > 1:
            u, v = ((kv.start + kv.stop) / 2 for kv in (surface.kv_u, surface.kv_v))
            heights[k] = float(surface([u], [v])[0, 2])
    if len(heights) != 2:
        raise ValueError(
            f"the file holds {len(heights)} curved spline faces where a lens has 2, front and rear"
        )
    front, rear = sorted(heights, key=lambda k: heights[k])
    return front, rear


def occt_trace(
    solid: TopoDS_Shape,
    optical: tuple[int, int],
    origins: Rows,
    directions: Rows,
    index: float,
    target_z: float,
) -> LandingPoints:
    """Trace rays of 1 W through the front and the rear of a solid, by OCCT's intersections.

    They end in the plane z = target_z, or in the far field (degrees).

    optical : indices of front and rear among the faces.
    origins, directions : (n, 3) float, mm and unit vectors.  target_z : mm, inf is the far field.
    """
    landing, flux = np.full((len(origins), 2), np.nan), np.zeros(len(origins))
    points, onward = origins, directions
    lit, weight = np.arange(len(origins)), np.ones(len(origins))
    for face, eta in zip(optical, (1 / index, index)):
        hits = face_hits(solid, points, onward)
        onward, transmittance = _refracted(onward, hits.normals, eta)
        passes = (hits.faces == face) & (transmittance > 0)
        points, onward, lit = hits.points[passes], onward[passes], lit[passes]
        weight = weight[passes] * transmittance[passes]
    forward = onward[:, 2] > 0
    points, onward, lit = points[forward], onward[forward], lit[forward]
    across = onward[:, :2] / onward[:, 2:]
    if isinf(target_z):
        landing[lit] = np.degrees(np.arctan(across))
    else:
        landing[lit] = points[:, :2] + (target_z - points[:, 2:]) * across
    flux[lit] = weight[forward]
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
