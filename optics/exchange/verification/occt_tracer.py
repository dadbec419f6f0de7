"""Rays through the faces of a STEP file by OCCT's intersections."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from optics.exchange.verification.rays_behind import RaysBehind, across_to
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
    fields = rays.polarised.copy()
    for which, eta in crossed:
        lit = np.flatnonzero(weight > 0)
        hits, before = face_hits(solid, points[lit], onward[lit]), onward[lit]
        normals = hits.normals * np.sign(np.einsum("ij,ij->i", before, hits.normals))[:, None]
        if eta is None:
            along, matrix = _mirrored(before, normals)
        else:
            along, matrix = _refracted(before, normals, eta)
        passes = (hits.faces == optical[which]) & (eta is None or along[:, 2] * before[:, 2] > 0)
        swinging = np.einsum("nij,nkj->nki", matrix, fields[lit])
        passing = np.where(passes, (np.abs(swinging) ** 2).sum(axis=(1, 2)) / 2, 0.0)
        lives = passing > 0
        points[lit[passes]], onward[lit[passes]] = hits.points[passes], along[passes]
        fields[lit[lives]] = swinging[lives] / np.sqrt(passing[lives])[:, None, None]
        weight[lit] *= passing
    return RaysBehind(points, onward, weight, fields)


def _mirrored(directions: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Return (directions, matrices of fields) behind an ideal mirror, which takes E to 2 (n . E) n - E."""
    across = np.einsum("ij,ij->i", directions, normals)
    matrix = 2 * normals[:, :, None] * normals[:, None, :] - np.eye(3)
    return directions - 2 * across[:, None] * normals, matrix


def _refracted(directions: Floats, normals: Floats, eta: float) -> tuple[Floats, Floats]:
    """Return (directions, matrices of fields, (n, 3, 3)) by Snell's law and Fresnel's equations, 0 where
    light is totally reflected.

    With s across the plane of incidence, p and q in it across the directions before and behind the face, the
    matrix is t_s s s^T + t_p q p^T, and its squares are powers: for the cosines a and b of the angles to the
    normal t_s = 2 sqrt(eta a b) / (eta a + b) and t_p = 2 sqrt(eta a b) / (a + eta b).

    eta : index before / index behind.  normals : along the directions.
    """
    a = np.einsum("ij,ij->i", directions, normals)
    square = 1 - eta**2 * (1 - a**2)
    passes = square > 0
    b = np.sqrt(np.where(passes, square, 1.0))
    onward = eta * directions + (b - eta * a)[:, None] * normals
    plane = np.cross(directions, normals)
    oblique = np.linalg.norm(plane, axis=1) > 0
    s = np.where(oblique[:, None], plane, across_to(directions))
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    p, q = np.cross(directions, s), np.cross(onward, s)
    root = np.where(passes, 2 * np.sqrt(eta * a * b), 0.0)
    t_s, t_p = ((root / parts)[:, None, None] for parts in (eta * a + b, a + eta * b))
    return onward, t_s * s[:, :, None] * s[:, None, :] + t_p * q[:, :, None] * p[:, None, :]
