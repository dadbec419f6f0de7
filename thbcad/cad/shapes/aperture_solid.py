"""The lens cut to an elliptic aperture, as an OCCT solid with explicit shared topology.

Front and rear keep their whole surface, trimmed by the ellipse.  Nothing is cut by Boolean operations.
"""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.TopoDS import TopoDS_Face

from thbcad.cad.shapes.edge_faces import face_on
from thbcad.cad.shapes.forms import ConicForm, FlatForm, conic_form
from thbcad.cad.shapes.occt_splines import geom_surface, trace
from thbcad.cad.shapes.part import Part
from thbcad.cad.shapes.rings import Ring, wall_faces
from thbcad.cad.shapes.topology import closed_part, turned_face
from thbcad.cad.shapes.walls import EllipticWall
from thbcad.checks import Floats
from thbcad.lens import Lens, optical_forms, require_aperture, require_sound
from thbcad.outlines import Ellipse, fitted_curve, rim_curve
from thbcad.sags import PlacedConic

HALVES = ("edge 1", "edge 2")


def trimmed_part(lens: Lens, semi_axes: tuple[float, float]) -> Part:
    """Return the lens within x^2 / a^2 + y^2 / b^2 <= 1 as a closed Part of four faces: front, rear and two
    half-cylinders.

    semi_axes : (a, b) float, mm

    Rims on planes are exact ellipses, round rims on conics exact circles.  Others lie within 1e-9 mm of front
    and rear, at eight points of every span; their traces on splines are the same splines, since x and y are
    linear in the parameters.

    Raises
    ------
    ValueError : as `require_sound`; semi-axes that are not two positive numbers or exceed a half-width.
    """
    ellipse = require_aperture(require_sound(lens), semi_axes)
    builder = BRep_Builder()
    wall = EllipticWall(ellipse)
    (front, low), (rear, high) = elliptic_faces(builder, lens, ellipse)
    return closed_part(("front", "rear", *HALVES), (front, rear, *wall_faces(builder, wall, low, high)))


def elliptic_faces(builder: BRep_Builder, lens: Lens, ellipse: Ellipse) -> list[tuple[TopoDS_Face, Ring]]:
    """Return (face, ring of its rim) of front and rear, trimmed by the ellipse, normals outward."""
    optical = []
    for k, surface in enumerate(optical_forms(lens)):
        if isinstance(surface, PlacedConic):
            form = conic_form(surface)
            face, ring = _conic_face(builder, form, ellipse)
            upward = form.upward
        else:
            curves = [rim_curve(lens.own_graphs()[k], ellipse, half) for half in (0, 1)]
            # from x and y to parameters, which are those over the rear's rectangle
            scale = np.divide(lens.rear.half_width, (lens.front, lens.rear)[k].half_width)
            lift = np.array([0.0, 0.0, k * lens.thickness])
            ring = EllipticWall(ellipse).rim(builder, [(kv, poles + lift) for kv, poles in curves])
            images = [trace(kv, poles[:, :2] * scale) for kv, poles in curves]
            face = face_on(builder, geom_surface(surface), ring.edges, True, images)
            upward = True
        optical.append((turned_face(face, upward != (k == 1)), ring))
    return optical


def _conic_face(
    builder: BRep_Builder, form: FlatForm | ConicForm, ellipse: Ellipse
) -> tuple[TopoDS_Face, Ring]:
    """Return face and ring on a conic; the rim is an exact circle or ellipse where it lies in a plane."""
    wall, conic = EllipticWall(ellipse), form.conic
    a, b = ellipse.semi_axes

    def points(t: Floats) -> Floats:
        x, y = ellipse(t)
        return np.column_stack([x, y, conic(x, y) + 0 * x])

    if a == b or conic.kind == "PLANE":
        ring = wall.level(builder, float(conic(a, 0.0)))
    else:
        ends = (np.array(pair) for pair in wall.ends)
        ring = wall.rim(builder, [fitted_curve(points, pair, np.array([1, 1])) for pair in ends])
    images = [form.trace(points, pair) for pair in wall.ends]
    return face_on(builder, form.surface(), ring.edges, form.upward, images), ring
