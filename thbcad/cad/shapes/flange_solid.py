"""The lens with a planar mounting flange, as an OCCT solid with explicit shared topology.

The flange is a frame round the lens: its two planes cut the edges of the lens, never the front or the rear.
"""

from thbcad.cad.shapes.forms import form_of, optical_face
from thbcad.cad.shapes.lens_parts import Bounded, bounded_faces
from thbcad.cad.shapes.topology import Part, closed_part
from thbcad.cad.shapes.walls import RuledWall, UprightWall, Wall, form_ring, plane_face, wall_faces
from thbcad.lens import (
    Flange,
    Lens,
    edge_names,
    optical_forms,
    require_clear,
    require_sound,
    walls_of,
)
from thbcad.outlines import UPRIGHT, Outline

HALVES = ("edge 1", "edge 2")  # of an aperture


def flanged_part(lens: Lens, flange: Flange, semi_axes: tuple[float, float] | None = None) -> Part:
    """Return the lens with a flange as a closed Part: front, rear, edges on both sides of the flange, the
    flange's faces.

    semi_axes : (a, b) float of an elliptic aperture, mm, as in `trimmed_part`; None is the whole lens

    Edges between surfaces of different size are ruled; the flange meets them within 1e-9 mm, at eight points
    of every span.

    Raises ValueError : as `trimmed_part` and `require_sound`; a rim less than 1e-6 mm away from the flange.
    """
    require_clear(require_sound(lens), flange, semi_axes)
    shape = walls_of(lens, semi_axes)
    planar = semi_axes is not None or lens.taper == UPRIGHT
    wall, (front, bottom), (rear, top) = walled_lens(lens, shape, planar)
    outline = UprightWall(flange.around(shape).pieces)
    edges = HALVES if semi_axes is not None else edge_names(lens)
    inner, outer = ([w.level(z) for z in (flange.low, flange.high)] for w in (wall, outline))
    faces = [front, rear, *wall_faces(wall, bottom, inner[0]), *wall_faces(wall, inner[1], top)]
    faces += [plane_face(z, [inner[k]], outer[k], k == 1) for k, z in enumerate((flange.low, flange.high))]
    faces += wall_faces(outline, *outer)
    names = [f"{edge} {side}" for side in ("front", "rear") for edge in edges]
    sides = [edge.replace("edge", "flange side") for edge in edges]
    return closed_part(("front", "rear", *names, "flange front", "flange rear", *sides), faces)


def walled_lens(lens: Lens, shape: Outline, planar: bool) -> tuple[Wall, Bounded, Bounded]:
    """Return the wall of the edges within an outline, and front and rear with the rings of their rims."""
    wall = UprightWall(shape.pieces) if planar else RuledWall.of(lens)
    if not shape.is_rectangle:
        return wall, *bounded_faces(lens, wall)
    optical = []
    for k, surface in enumerate(optical_forms(lens)):
        form = form_of(surface)
        ring = wall.sides(form, float(k)) if isinstance(wall, RuledWall) else form_ring(form)
        optical.append((optical_face(form, ring.edges, outward=k == 1), ring))
    front, rear = optical
    return wall, front, rear
