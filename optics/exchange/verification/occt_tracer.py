"""Rays through the faces of a STEP file by OCCT's intersections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.exchange.verification.reference_tracer import last_step
from optics.light.tracing import LandingPoints
from optics.scene.receivers import Receiver
from thbcad.cad.exchange import face_hits
from thbcad.io import Brep, BrepFace
from thbcad.lens import OpticalForm
from thbcad.sags import PlacedConic, conic_of_patch, conic_of_plane, conic_of_sphere, rectangle_around
from thbcad.splines import BSplineSurface

if TYPE_CHECKING:
    from thbcad.cad.exchange import TopoDS_Shape

Rows = NDArray[np.float64]

MISCOUNTED = "optical faces where a lens has 2, front and rear"


def optical_faces(solid: Brep) -> tuple[int, int]:
    """Return the indices of front and rear among the faces.

    They are the faces of these names.  Where the names are missing or not unique, they are the lowest and the
    highest of the faces that are splines curved in both directions, or planes, spheres and patches of conics
    without holes across the middle: that of a spline, else that of the solid.

    Raises
    ------
    ValueError : there are not two.
    """
    names = [face.name for face in solid.faces]
    if names.count("front") == names.count("rear") == 1:
        return names.index("front"), names.index("rear")
    forms = {k: optical_form(solid, face) for k, face in enumerate(solid.faces)}
    centres = {k: _centre(form) for k, form in forms.items() if isinstance(form, BSplineSurface)}
    if len(centres) > 2:
        raise ValueError(f"the file holds {len(centres)} {MISCOUNTED}")
    ends = np.concatenate([edge.ends for edge in solid.edges])
    middle = next(iter(centres.values()), (ends.min(axis=0) + ends.max(axis=0)) / 2)[:2]
    heights = {k: float(centre[2]) for k, centre in centres.items()}
    for k, form in forms.items():
        if isinstance(form, PlacedConic) and len(solid.faces[k].loops) == 1:
            own = face_corners(solid, solid.faces[k])[:, :2]
            if (own.min(axis=0) <= middle).all() and (middle <= own.max(axis=0)).all():
                heights[k] = float(form(*middle))
    order = sorted(heights, key=lambda k: heights[k])
    if len(order) < 2:
        raise ValueError(f"the file holds {len(order)} {MISCOUNTED}")
    return order[0], order[-1]


def _centre(spline: BSplineSurface) -> Rows:
    """Return the point at the middle of the parameters, (3,), mm."""
    u, v = ((kv.start + kv.stop) / 2 for kv in (spline.kv_u, spline.kv_v))
    point: Rows = spline([u], [v])[0]
    return point


def optical_form(solid: Brep, face: BrepFace) -> OpticalForm | None:
    """Return the surface under a face as a record; None unless it can be that of a front or a rear: a spline
    curved in both directions, a plane across z, a sphere or a patch of a conic around z."""
    surface = face.surface
    if isinstance(surface, BSplineSurface):
        # the ruled edges are straight in one direction
        return surface if min(surface.kv_u.degree, surface.kv_v.degree) > 1 else None
    corners = face_corners(solid, face)
    half_width = rectangle_around(corners)
    if face.plane is not None:
        return conic_of_plane(face.plane, half_width)
    if face.sphere is not None:
        below = bool(corners[:, 2].sum() < len(corners) * face.sphere[0, 2])
        return conic_of_sphere(face.sphere[:3], float(face.sphere[3, 0]), below, half_width)
    return None if surface is None else conic_of_patch(surface, half_width)


def face_corners(solid: Brep, face: BrepFace) -> Rows:
    """Return the ends of the edges around a face, (n, 3), mm."""
    numbers = {number for loop in face.loops for number, _ in loop}
    ends = [edge.ends for edge in solid.edges if edge.number in numbers]
    return np.concatenate(ends) if ends else np.empty((0, 3))


def occt_trace(
    solid: TopoDS_Shape,
    optical: tuple[int, int],
    origins: Rows,
    directions: Rows,
    index: float,
    target: Receiver,
) -> LandingPoints:
    """Trace rays of 1 W through the front and the rear of a solid, by OCCT's intersections.

    optical : indices of front and rear among the faces.
    origins, directions : (n, 3) float, mm and unit vectors.
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
    ends, meets = last_step(points, onward, target)
    arrives = (onward[:, 2] > 0) & meets
    landing[lit[arrives]], flux[lit[arrives]] = ends[arrives], weight[arrives]
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
