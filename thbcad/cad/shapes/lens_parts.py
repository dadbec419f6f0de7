"""The lens as an OCCT solid with explicit shared topology: of a rectangle 8 vertices, 12 edges, 6 faces, or
within an outline, its own, an aperture or a polygon.

Front and rear keep their whole surface, trimmed by the outline.  Nothing is sewn, and nothing is cut by
Boolean operations.
"""

from collections.abc import Sequence

import numpy as np
from OCP.Geom2d import Geom2d_Curve
from OCP.TopoDS import TopoDS_Face, TopoDS_Solid

from thbcad.cad.shapes.forms import ConicForm, form_of, optical_face, ruled_trace
from thbcad.cad.shapes.occt_splines import geom_surface, trace
from thbcad.cad.shapes.topology import (
    NAMES,
    Part,
    closed_part,
    face_on,
    new_edge,
    new_vertex,
    plane_edge_face,
    ruled_edge_face,
    strut,
    turned,
    turned_face,
)
from thbcad.cad.shapes.walls import Ring, RuledWall, UprightWall, wall_faces
from thbcad.lens import (
    CORNERS,
    SIDES,
    Lens,
    OpticalForm,
    Rim,
    above,
    optical_forms,
    outline_rims,
    require_aperture,
    require_polygon,
    require_sound,
    rim_pieces,
    ruled_edges,
)
from thbcad.outlines import UPRIGHT, Arc, Line, Path, RimPiece
from thbcad.sags import PlacedConic
from thbcad.splines import UNIT, BSplineSurface

Bounded = tuple[TopoDS_Face, Ring]  # front or rear, and the ring of its rim


def trimmed_part(lens: Lens, semi_axes: tuple[float, float]) -> Part:
    """Return the lens within x^2 / a^2 + y^2 / b^2 <= 1 as a closed Part of four faces: front, rear and two
    half-cylinders.

    semi_axes : (a, b) float, mm

    Raises ValueError : as `require_sound`; semi-axes that are not two positive numbers or exceed a
        half-width.
    """
    return _walled(lens, UprightWall(require_aperture(require_sound(lens), semi_axes).pieces))


def polygon_part(lens: Lens, corners: Sequence[tuple[float, float]]) -> Part:
    """Return the lens within a polygon as a closed Part: front, rear and a plane face on every side.

    corners : (x, y) float, mm, of a polygon as `Polygon`

    Raises ValueError : as `require_sound` and `require_polygon`.
    """
    return _walled(lens, UprightWall(require_polygon(require_sound(lens), corners).pieces))


def _walled(lens: Lens, wall: UprightWall | RuledWall) -> Part:
    """Return a sound lens within a wall over an outline as a closed Part: front, rear, and an edge on every
    piece of the outline."""
    (front, bottom), (rear, top) = bounded_faces(lens, wall)
    edges = wall_faces(wall, bottom, top)
    names = [f"edge {k + 1}" for k in range(len(edges))]
    return closed_part(("front", "rear", *names), (front, rear, *edges))


def bounded_faces(lens: Lens, wall: UprightWall | RuledWall) -> tuple[Bounded, Bounded]:
    """Return front and rear, trimmed by a wall over an outline, normals outward.

    A ruled wall stands between the outlines of front and rear.
    """
    if isinstance(wall, UprightWall):
        return upright_face(lens, 0, wall), upright_face(lens, 1, wall)
    optical = []
    for k, pieces in enumerate(rim_pieces(lens)):
        rims = [(panel.kv_u, panel.coefficients[:, k]) for panel in wall.panels]
        ring = wall.along(rims, float(k))
        optical.append((trimmed_face(lens, k, pieces, rims, ring), ring))
    front, rear = optical
    return front, rear


def upright_face(lens: Lens, k: int, wall: UprightWall) -> Bounded:
    """Return the front (k = 0) or the rear (k = 1), trimmed by an upright wall, its normal outward.

    Rims on planes are lines and exact ellipses, round rims on conics exact circles; others are as
    `outline_rims`.
    """
    height = _level(optical_forms(lens)[k], wall.pieces)
    rims = outline_rims(lens, k, wall.pieces) if height is None else []
    ring = wall.rim(rims) if height is None else wall.level(height)
    return trimmed_face(lens, k, wall.pieces, rims, ring), ring


def _level(surface: OpticalForm, pieces: Sequence[RimPiece]) -> float | None:
    """Return the z of a level rim, mm: on a plane, and of a circle round the axis of a conic."""
    if not isinstance(surface, PlacedConic):
        return None
    if surface.kind == "PLANE":
        return surface.vertex
    arcs = [p for p in pieces if isinstance(p, Arc) and p.is_round and p.centre == (0.0, 0.0)]
    return float(surface(arcs[0].semi_axes[0], 0.0)) if len(arcs) == len(pieces) else None


def trimmed_face(lens: Lens, k: int, pieces: Sequence[Path], rims: Sequence[Rim], ring: Ring) -> TopoDS_Face:
    """Return the front (k = 0) or the rear (k = 1) within the ring above the pieces of an outline, its normal
    outward.

    rims : of splines, as `outline_rims`
    """
    surface = optical_forms(lens)[k]
    images: list[Geom2d_Curve | None]
    if isinstance(surface, PlacedConic):
        form = ConicForm(surface)
        images = [form.trace(above(surface, piece), piece.ends) for piece in pieces]
        face = face_on(form.surface(), ring.edges, form.upward, images)
        return turned_face(face, form.upward != (k == 1))
    # from x and y to parameters, which are those over the rear's rectangle
    scale = np.divide(lens.rear.half_width, (lens.front, lens.rear)[k].half_width)
    images = []
    for piece, (kv, poles) in zip(pieces, rims):
        if isinstance(piece, Line):
            images.append(trace(UNIT, np.array([piece.start, piece.stop]) * scale))
        else:
            images.append(trace(kv, poles[:, :2] * scale))
    return turned_face(face_on(geom_surface(surface), ring.edges, True, images), k == 0)


def lens_solid(lens: Lens) -> TopoDS_Solid:
    """Return the lens as a closed TopoDS_Solid."""
    return lens_part(lens).solid


def lens_part(lens: Lens) -> Part:
    """Return the lens as a closed Part: front, rear and the edges, of a rectangle in the order of SIDES, else
    one on every piece of the outline.

    Raises ValueError : as `require_sound`.
    """
    planar = lens.taper == UPRIGHT
    outline = require_sound(lens).rear.outline
    if not outline.is_rectangle:
        return _walled(lens, UprightWall(outline.pieces) if planar else RuledWall.of(lens))
    return part_between(optical_forms(lens), None if planar else ruled_edges(lens))


def part_between(surfaces: Sequence[OpticalForm], ruled: Sequence[BSplineSurface] | None) -> Part:
    """Return the closed Part between two surfaces and the edges between their rims; nothing is proven.

    surfaces : as `optical_forms`
    ruled : the edges as `ruled_edges`; None where both surfaces have the same size, so that they are planes
    """
    forms = [form_of(surface) for surface in surfaces]
    corners = [{c: form.corner(c) for c in CORNERS} for form in forms]
    vertices = [{c: new_vertex(point) for c, point in own.items()} for own in corners]
    rims = [{side: form.rim(side) for side in SIDES} for form in forms]
    edges = [
        {
            side: new_edge(along.curve, *along.ends, own[side.start], own[side.stop])
            for side, along in curves.items()
        }
        for curves, own in zip(rims, vertices)
    ]
    struts = {
        c: strut([own[c] for own in corners], [own[c] for own in vertices], ruled is None) for c in CORNERS
    }
    loops = [[turned(own[side], side.clockwise) for side in SIDES] for own in edges]
    faces = [optical_face(forms[k], loops[k], outward=k == 1) for k in (0, 1)]
    for k, side in enumerate(SIDES):
        front, rear = (own[side] for own in edges)
        chains = [[front], [struts[side.stop]], [rear.Reversed()], [struts[side.start].Reversed()]]
        if ruled is None:
            faces.append(plane_edge_face(corners[0][side.start], side, chains))
        else:
            images = [ruled_trace(own[side], side, ruled[k], float(v)) for v, own in enumerate(rims)]
            faces.append(ruled_edge_face(ruled[k], side, chains, images))
    return closed_part(NAMES, faces)
