"""Rays through the faces of a STEP file by OCCT's intersections."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from optics.exchange.verification.rays_behind import RaysBehind
from thbcad.cad.exchange import face_hits
from thbcad.checks import Floats

if TYPE_CHECKING:
    from thbcad.cad.exchange import TopoDS_Shape


Crossed = tuple[int, float | None]  # front or rear (0, 1), and index before / behind; None reflects all


def occt_through(
    solid: TopoDS_Shape, optical: tuple[int, int], rays: RaysBehind, crossed: Sequence[Crossed]
) -> RaysBehind:
    """Trace rays through the front and the rear of a solid, by OCCT's intersections.

    optical : indices of front and rear among the faces.
    """
    points, onward, weight = rays.points.copy(), rays.directions.copy(), rays.flux.copy()
    for which, eta in crossed:
        lit = np.flatnonzero(weight > 0)
        hits, along = face_hits(solid, points[lit], onward[lit]), onward[lit]
        if eta is None:
            across, passing = np.einsum("ij,ij->i", along, hits.normals), np.ones(len(along))
            along = along - 2 * across[:, None] * hits.normals
        else:
            before = along
            along, passing = _refracted(before, hits.normals, eta)
            passing = np.where(along[:, 2] * before[:, 2] > 0, passing, 0.0)
        passes = hits.faces == optical[which]
        points[lit[passes]], onward[lit[passes]] = hits.points[passes], along[passes]
        weight[lit] *= np.where(passes, passing, 0.0)
    return RaysBehind(points, onward, weight)


def _refracted(directions: Floats, normals: Floats, eta: float) -> tuple[Floats, Floats]:
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
