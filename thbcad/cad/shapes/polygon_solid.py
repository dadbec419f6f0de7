"""The lens cut to a polygon, as an OCCT solid with explicit shared topology.

Front and rear keep their whole surface, trimmed by the polygon.  Nothing is cut by Boolean operations.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.TopoDS import TopoDS

from thbcad.cad.shapes.edge_faces import face_on
from thbcad.cad.shapes.forms import conic_form, form_of
from thbcad.cad.shapes.occt_splines import TOLERANCE, trace
from thbcad.cad.shapes.rings import wall_faces
from thbcad.cad.shapes.topology import closed_part, turned_face
from thbcad.cad.shapes.walls import PlaneWall
from thbcad.lens import fitted_curve, optical_forms, require_polygon, require_sound, side_curve
from thbcad.sags import PlacedConic
from thbcad.splines import UNIT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from OCP.Geom2d import Geom2d_Curve
    from OCP.TopoDS import TopoDS_Face

    from thbcad.cad.shapes.part import Part
    from thbcad.cad.shapes.rings import Ring
    from thbcad.checks import Floats
    from thbcad.lens import Lens

SPAN, WHOLE = np.array([0.0, 1.0]), np.array([1, 1])  # a smooth curve over [0, 1]: its ends, no inner knots


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
    (front, low), (rear, high) = (_optical_face(builder, lens, wall, polygon.sides, k) for k in (0, 1))
    names = [f"edge {k + 1}" for k in range(len(polygon.corners))]
    return closed_part(("front", "rear", *names), (front, rear, *wall_faces(builder, wall, low, high)))


def _optical_face(
    builder: BRep_Builder, lens: Lens, wall: PlaneWall, sides: Floats, k: int
) -> tuple[TopoDS_Face, Ring]:
    """Return (face, ring of its rim) of the front (k = 0) or the rear (k = 1), its normal outward.

    sides : of the polygon, start and stop, (n, 2, 2), mm
    """
    surface = optical_forms(lens)[k]
    form = form_of(surface)
    images: list[Geom2d_Curve | None]
    if isinstance(surface, PlacedConic):
        above = [partial(_above, surface, side) for side in sides]
        ring = (
            wall.level(builder, surface.vertex)
            if surface.kind == "PLANE"
            else wall.rim(builder, [fitted_curve(curve, SPAN, WHOLE) for curve in above])
        )
        images = [conic_form(surface).trace(curve, (0.0, 1.0)) for curve in above]
    else:
        lift = np.array([0.0, 0.0, k * lens.thickness])
        curves = [side_curve(lens.graphs()[k], *side) for side in sides]
        ring = wall.rim(builder, [(kv, poles + lift) for kv, poles in curves])
        # from x and y to parameters, which are those over the rear's rectangle
        scale = np.divide(lens.rear.half_width, (lens.front, lens.rear)[k].half_width)
        images = [trace(UNIT, side * scale) for side in sides]
    face = face_on(builder, form.surface(), ring.edges, form.upward)
    for edge, image in zip(ring.edges, images):
        if image is not None:
            builder.UpdateEdge(TopoDS.Edge_s(edge), image, face, TOLERANCE)
    return turned_face(face, form.upward != (k == 1)), ring


def _above(conic: PlacedConic, side: Floats, t: Floats) -> Floats:
    """Return the points of a conic above a side at t from 0 to 1, (n, 3), mm."""
    x, y = (side[0] + t[:, None] * (side[1] - side[0])).T
    return np.column_stack([x, y, conic(x, y)])
