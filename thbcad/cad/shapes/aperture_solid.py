"""The lens cut to an elliptic aperture, as an OCCT solid with explicit shared topology.

Front and rear keep their whole tensor-product spline, trimmed by the ellipse.  Nothing is cut by Boolean
operations.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.TopoDS import TopoDS

from thbcad.cad.shapes.occt_splines import TOLERANCE
from thbcad.cad.shapes.rings import wall_faces
from thbcad.cad.shapes.topology import closed_part, spline_face
from thbcad.cad.shapes.walls import EllipticWall, trace
from thbcad.lens import Ellipse, placed_surfaces, require_aperture, require_sound, rim_curve

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Face

    from thbcad.cad.shapes.part import Part
    from thbcad.cad.shapes.rings import Ring
    from thbcad.lens import Lens

HALVES = ("edge 1", "edge 2")


def trimmed_part(lens: Lens, semi_axes: tuple[float, float]) -> Part:
    """Return the lens within x^2 / a^2 + y^2 / b^2 <= 1 as a closed Part of four faces: front, rear and two
    half-cylinders.

    semi_axes : (a, b) float, mm

    Rims lie within 1e-9 mm of front and rear, at eight points of every span; their traces on front and rear
    are the same splines, since x and y are linear in the parameters.

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
    rectangle = lens.rear.half_width
    for k, (graph, surface, freeform) in enumerate(
        zip(lens.graphs(), placed_surfaces(lens), (lens.front, lens.rear))
    ):
        curves = [rim_curve(graph, ellipse, half) for half in (0, 1)]
        lifted = [(kv, poles + np.array([0.0, 0.0, k * lens.thickness])) for kv, poles in curves]
        ring = EllipticWall(ellipse).rim(builder, lifted)
        face = spline_face(builder, surface, ring.edges)
        scale = np.divide(rectangle, freeform.half_width)
        for edge, (kv, poles) in zip(ring.edges, curves):
            builder.UpdateEdge(TopoDS.Edge_s(edge), trace(kv, poles[:, :2] * scale), face, TOLERANCE)
        optical.append((face if k else TopoDS.Face_s(face.Reversed()), ring))
    return optical
