"""Rays through the faces of a STEP file by OCCT's intersections."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from optics.exchange.verification.rays_behind import RaysBehind
from optics.exchange.verification.reference_tracer import refract
from optics.exchange.verification.traced_faces import dot
from optics.light.tracing import LandingPoints
from optics.scene.receivers import Receiver
from thbcad.cad.exchange import face_hits
from thbcad.checks import Floats

if TYPE_CHECKING:
    from thbcad.cad.exchange import TopoDS_Shape

Crossed = tuple[int, float | None]  # front or rear (0, 1), and index before / behind; None reflects all


def occt_trace(
    solid: TopoDS_Shape,
    optical: tuple[int, int],
    origins: Floats,
    directions: Floats,
    index: float | None,
    target: Receiver,
) -> LandingPoints:
    """Trace rays of 1 W through the front and the rear of a solid to a target, as `occt_through`.

    origins, directions : (n, 3) float, mm and unit vectors.
    """
    rays = RaysBehind(origins, directions, np.ones(len(origins)))
    faces = [(0, None)] if index is None else [(0, 1 / index), (1, index)]
    return occt_through(solid, optical, rays, faces).landing(target)


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
        across = dot(along, hits.normals)
        if eta is None:
            passing = np.ones(len(along))
            along = along - 2 * across[:, None] * hits.normals
        else:
            before = along
            along, passing = refract(before, np.sign(across)[:, None] * hits.normals, eta)
            passing = np.where(along[:, 2] * before[:, 2] > 0, passing, 0.0)
        passes = hits.faces == optical[which]
        points[lit[passes]], onward[lit[passes]] = hits.points[passes], along[passes]
        weight[lit] *= np.where(passes, passing, 0.0)
    return RaysBehind(points, onward, weight)
