"""The lens as an OCCT solid with explicit shared topology: of a rectangle 8 vertices, 12 edges, 6 faces.

Nothing is sewn.
"""

from __future__ import annotations

from collections.abc import Sequence

from OCP.BRep import BRep_Builder
from OCP.TopoDS import TopoDS_Solid

from thbcad.cad.shapes.forms import form_of, optical_face, ruled_trace
from thbcad.cad.shapes.topology import (
    NAMES,
    Part,
    closed_part,
    new_edge,
    new_vertex,
    plane_edge_face,
    ruled_edge_face,
    strut,
)
from thbcad.cad.shapes.trimmed_solid import ruled_part, upright_part
from thbcad.lens import CORNERS, SIDES, Lens, OpticalForm, optical_forms, require_sound, ruled_edges
from thbcad.outlines import UPRIGHT
from thbcad.splines import BSplineSurface


def lens_solid(lens: Lens) -> TopoDS_Solid:
    """Return the lens as a closed TopoDS_Solid."""
    return lens_part(lens).solid


def lens_part(lens: Lens) -> Part:
    """Return the lens as a closed Part: front, rear and the edges, of a rectangle in the order of SIDES, else
    one on every piece of the outline.

    Raises
    ------
    ValueError : as `require_sound`.
    """
    planar = lens.taper == UPRIGHT
    outline = require_sound(lens).rear.outline
    if not outline.is_rectangle:
        return upright_part(lens, outline) if planar else ruled_part(lens)
    return part_between(optical_forms(lens), None if planar else ruled_edges(lens))


def part_between(surfaces: Sequence[OpticalForm], ruled: Sequence[BSplineSurface] | None) -> Part:
    """Return the closed Part between two surfaces and the edges between their rims; nothing is proven.

    surfaces : as `optical_forms`
    ruled : the edges as `ruled_edges`; None where both surfaces have the same size, so that they are planes
    """
    builder = BRep_Builder()
    forms = [form_of(surface) for surface in surfaces]
    corners = [{c: form.corner(c) for c in CORNERS} for form in forms]
    vertices = [{c: new_vertex(builder, point) for c, point in own.items()} for own in corners]
    rims = [{side: form.rim(side) for side in SIDES} for form in forms]
    edges = [
        {
            side: new_edge(builder, along.curve, *along.ends, own[side.start], own[side.stop])
            for side, along in curves.items()
        }
        for curves, own in zip(rims, vertices)
    ]
    struts = {
        c: strut(builder, [own[c] for own in corners], [own[c] for own in vertices], ruled is None)
        for c in CORNERS
    }
    faces = [optical_face(builder, forms[k], edges[k], outward=k == 1) for k in (0, 1)]
    for k, side in enumerate(SIDES):
        front, rear = (own[side] for own in edges)
        chains = [[front], [struts[side.stop]], [rear.Reversed()], [struts[side.start].Reversed()]]
        if ruled is None:
            faces.append(plane_edge_face(builder, corners[0][side.start], side, chains))
        else:
            images = [ruled_trace(own[side], side, ruled[k], float(v)) for v, own in enumerate(rims)]
            faces.append(ruled_edge_face(builder, ruled[k], side, chains, images))
    return closed_part(NAMES, faces)
