"""The lens with a planar mounting flange, as an OCCT solid with explicit shared topology.

The flange is a frame round the lens: its two planes cut the edges of the lens, never the front or the rear.
"""

from __future__ import annotations

from collections.abc import Sequence

from OCP.BRep import BRep_Builder
from OCP.TopoDS import TopoDS, TopoDS_Face

from thbcad.cad.shapes.aperture_solid import HALVES, elliptic_faces
from thbcad.cad.shapes.forms import form_of, optical_face
from thbcad.cad.shapes.part import Part
from thbcad.cad.shapes.rings import Ring, Wall, plane_face, wall_faces
from thbcad.cad.shapes.topology import NAMES, closed_part, turned
from thbcad.cad.shapes.walls import EllipticWall, PlaneWall, RuledWall, form_ring
from thbcad.lens import (
    SIDES,
    Flange,
    Lens,
    optical_forms,
    require_aperture,
    require_clear,
    require_sound,
    ruled_edges,
)


def flanged_part(lens: Lens, flange: Flange, semi_axes: tuple[float, float] | None = None) -> Part:
    """Return the lens with a flange as a closed Part: front, rear, edges on both sides of the flange, the
    flange's faces.

    semi_axes : (a, b) float of an elliptic aperture, mm, as in `trimmed_part`; None is the rectangular lens

    Edges between surfaces of different size are ruled; the flange meets them within 1e-9 mm, at eight points
    of every span.

    Raises
    ------
    ValueError : as `trimmed_part` and `require_sound`; a rim less than 1e-6 mm away from the flange.
    """
    require_clear(require_sound(lens), flange, semi_axes)
    builder = BRep_Builder()
    wall: Wall
    outline: Wall
    edges: Sequence[str]
    if semi_axes is None:
        wall, (front, bottom), (rear, top) = _rectangular(builder, lens)
        outline = PlaneWall.rectangle(flange.rectangle(lens))
        edges = NAMES[2:]
    else:
        ellipse = require_aperture(lens, semi_axes)
        wall, ((front, bottom), (rear, top)) = EllipticWall(ellipse), elliptic_faces(builder, lens, ellipse)
        outline = EllipticWall(flange.ellipse(ellipse))
        edges = HALVES
    inner, outer = ([w.level(builder, z) for z in (flange.low, flange.high)] for w in (wall, outline))
    faces = [
        front,
        rear,
        *wall_faces(builder, wall, bottom, inner[0]),
        *wall_faces(builder, wall, inner[1], top),
    ]
    faces += [
        plane_face(builder, z, inner[k], outer[k], k == 1) for k, z in enumerate((flange.low, flange.high))
    ]
    faces += wall_faces(builder, outline, *outer)
    names = [f"{edge} {side}" for side in ("front", "rear") for edge in edges]
    sides = [edge.replace("edge", "flange side") for edge in edges]
    return closed_part(("front", "rear", *names, "flange front", "flange rear", *sides), faces)


def _rectangular(
    builder: BRep_Builder, lens: Lens
) -> tuple[Wall, tuple[TopoDS_Face, Ring], tuple[TopoDS_Face, Ring]]:
    """Return the wall of the edges and (face, ring of its rim) of front and rear."""
    planar = lens.front.half_width == lens.rear.half_width
    ruled = RuledWall([] if planar else ruled_edges(lens))
    optical = []
    for k, surface in enumerate(optical_forms(lens)):
        form = form_of(surface)
        ring = form_ring(builder, form) if planar else ruled.rim(builder, form, float(k))
        edges = {side: TopoDS.Edge_s(turned(edge, side.clockwise)) for side, edge in zip(SIDES, ring.edges)}
        optical.append((optical_face(builder, form, edges, outward=k == 1), ring))
    front, rear = optical
    return PlaneWall.rectangle(lens.rear.half_width) if planar else ruled, front, rear
