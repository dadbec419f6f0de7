"""The lens as an OCCT solid with explicit shared topology: 8 vertices, 12 edges, 6 faces.

Nothing is sewn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from OCP.BRep import BRep_Builder
from OCP.TopoDS import TopoDS

from thbcad.cad.shapes.occt_splines import TOLERANCE
from thbcad.cad.shapes.topology import (
    NAMES,
    closed_part,
    edge_face,
    new_vertex,
    rim_edge,
    side_line,
    spline_face,
    strut,
    turned,
)
from thbcad.lens import CORNERS, SIDES, Surfaces, placed_surfaces, require_sound

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Solid

    from thbcad.cad.shapes.part import Part
    from thbcad.lens import Lens


def lens_solid(lens: Lens) -> TopoDS_Solid:
    """Return the lens as a closed TopoDS_Solid of six faces."""
    return lens_part(lens).solid


def lens_part(lens: Lens) -> Part:
    """Return the lens as a closed Part of six faces: front, rear and the edges in the order of SIDES.

    Raises
    ------
    ValueError : as `require_sound`.
    """
    planar = lens.front.half_width == lens.rear.half_width
    return part_between(placed_surfaces(require_sound(lens)), planar)


def part_between(surfaces: Surfaces, planar: bool) -> Part:
    """Return the closed Part between two surfaces and the edges between their rims; nothing is proven.

    surfaces : as `placed_surfaces`.  planar : whether both have the same size, so that the edges are planes.
    """
    builder = BRep_Builder()
    vertices = [{c: new_vertex(builder, s.coefficients[c]) for c in CORNERS} for s in surfaces]
    rims = [{side: rim_edge(builder, s, side, own) for side in SIDES} for s, own in zip(surfaces, vertices)]
    struts = {corner: strut(builder, surfaces, corner, vertices, planar) for corner in CORNERS}

    faces = []
    for k, surface in enumerate(surfaces):
        face = spline_face(builder, surface, [turned(rims[k][side], side.clockwise) for side in SIDES])
        for side in SIDES:
            builder.UpdateEdge(rims[k][side], side_line(surface, side), face, TOLERANCE)
        # the normal of the parametrisation points to +z: outward at the rear, inward at the front
        faces.append(face if k == 1 else TopoDS.Face_s(face.Reversed()))
    for side in SIDES:
        loop = [rims[0][side], struts[side.stop], rims[1][side].Reversed(), struts[side.start].Reversed()]
        faces.append(edge_face(builder, surfaces, side, [[edge] for edge in loop], planar))
    return closed_part(NAMES, faces)
