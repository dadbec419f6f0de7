"""The lens cut to a polygon, as an OCCT solid with explicit shared topology.

Front and rear keep their whole surface, trimmed by the polygon.  Nothing is cut by Boolean operations.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.TopoDS import TopoDS_Face

from thbcad.cad.shapes.edge_faces import face_on
from thbcad.cad.shapes.forms import ConicForm, FlatForm, conic_form
from thbcad.cad.shapes.occt_splines import geom_surface, trace
from thbcad.cad.shapes.part import Part
from thbcad.cad.shapes.rings import Ring, wall_faces
from thbcad.cad.shapes.topology import closed_part, turned_face
from thbcad.cad.shapes.walls import PlaneWall
from thbcad.checks import Floats
from thbcad.lens import Lens, optical_forms, require_polygon, require_sound
from thbcad.outlines import fitted_curve, side_curve
from thbcad.sags import PlacedConic
from thbcad.splines import UNIT


def polygon_part(lens: Lens, corners: Sequence[tuple[float, float]]) -> Part:
    """Return the lens within a polygon as a closed Part: front, rear and a plane face on every side.

    corners : (x, y) float, mm, of a polygon as `Polygon`

    The rims are lines on planes, the splines that splines have above the sides (`side_curve`), and splines
    within 1e-9 mm of other conics, at eight points of every span.

    Raises
    ------
    ValueError : as `require_sound` and `require_polygon`.
    """
    polygon = require_polygon(require_sound(lens), corners)
    builder = BRep_Builder()
    wall = PlaneWall(polygon.corners)
    (front, low), (rear, high) = (_trimmed(builder, lens, wall, polygon.sides, k) for k in (0, 1))
    names = [f"edge {k + 1}" for k in range(len(polygon.corners))]
    return closed_part(("front", "rear", *names), (front, rear, *wall_faces(builder, wall, low, high)))


def _trimmed(
    builder: BRep_Builder, lens: Lens, wall: PlaneWall, sides: Floats, k: int
) -> tuple[TopoDS_Face, Ring]:
    """Return (face, ring of its rim) of the front (k = 0) or the rear (k = 1), its normal outward.

    sides : of the polygon, start and stop, (n, 2, 2), mm
    """
    surface = optical_forms(lens)[k]
    if isinstance(surface, PlacedConic):
        form = conic_form(surface)
        face, ring = _conic_face(builder, form, wall, sides)
        return turned_face(face, form.upward != (k == 1)), ring
    vertex = np.array([0.0, 0.0, k * lens.thickness])
    curves = [side_curve(lens.own_graphs()[k], *side) for side in sides]
    ring = wall.rim(builder, [(kv, poles + vertex) for kv, poles in curves])
    # from x and y to parameters, which are those over the rear's rectangle
    scale = np.divide(lens.rear.half_width, (lens.front, lens.rear)[k].half_width)
    images = [trace(UNIT, side * scale) for side in sides]
    face = face_on(builder, geom_surface(surface), ring.edges, True, images)
    return turned_face(face, k == 0), ring


def _conic_face(
    builder: BRep_Builder, form: FlatForm | ConicForm, wall: PlaneWall, sides: Floats
) -> tuple[TopoDS_Face, Ring]:
    """Return face and ring on a conic; rims on a plane are straight, others within 1e-9 mm."""
    if isinstance(form, FlatForm):
        ring = wall.level(builder, form.conic.vertex)
        return face_on(builder, form.surface(), ring.edges), ring
    unit, once = np.array([0.0, 1.0]), np.ones(2, dtype=np.int64)

    def above(side: Floats, t: Floats) -> Floats:
        x, y = (side[0] + np.outer(t, side[1] - side[0])).T
        return np.column_stack([x, y, form.conic(x, y)])

    rims = [partial(above, side) for side in sides]
    ring = wall.rim(builder, [fitted_curve(rim, unit, once) for rim in rims])
    images = [form.trace(rim, (0.0, 1.0)) for rim in rims]
    return face_on(builder, form.surface(), ring.edges, form.upward, images), ring
