"""The envelope of a problem's last element: points around every shape that the problem allows.

The envelope holds every lens of a problem: conic +- z_freedom of front and rear within their outlines, the
straight edges between their rims, and the land of a body; of a mirror it holds the face.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from scipy.spatial import ConvexHull

from optics.scene.problem import freedom_of
from optics.scene.system import System, body_options
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface
from thbcad.moulds import LAND_STEP

CELLS = 17  # of a surface in each direction, over each of which a plane touches its conic; one at the vertex
SIDES = 64  # of the polygon around an ellipse, whose area is 0.08 % larger
THIN = 1e-6  # of its half-width: the least freedom of a mirror's face, whose hull is a body then
SAMPLES = 33  # of a surface, each way
SIGNS = (1, 1), (1, -1), (-1, 1), (-1, -1)

Offsets: TypeAlias = list[tuple[Floats | float, Floats | float]]


def envelope(system: System) -> Floats:
    """Return points whose convex hull holds all faces of the last element, in its frame, (n, 3) mm.

    z_freedom must be known.
    """
    found = [_around(*face) for face in _last_faces(system)]
    for face, z in _land(system):
        found.append(np.pad(rim_around(face), ((0, 0), (0, 1)), constant_values=z))
    points = np.concatenate(found)
    return points[ConvexHull(points).vertices]


def _last_faces(system: System) -> list[tuple[FreeformSurface, float, float]]:
    """Return the faces of the last element that light meets: surface, z of its vertex, and freedom, mm."""
    met = system.problem.faces_met
    optic, used = met[-1].optic, {face.face for face in met if face.optic is met[-1].optic}
    (lens,) = (body for other, body in system.unshaped.elements if other is optic)
    faces = [(lens.front, 0.0, freedom_of(optic.front)), (lens.rear, lens.thickness, freedom_of(optic.rear))]
    if "rear" in used:
        return faces
    return [(lens.front, 0.0, max(freedom_of(optic.front), THIN * min(lens.front.half_width)))]


def _land(system: System) -> list[tuple[FreeformSurface, float]]:
    """Return the larger face of the last element's body with the z of its land, mm; none without land.

    A land that is left to the program lies outside of the rim of the smaller face, which z_freedom moves.
    """
    options = body_options(system.problem.faces_met[-1].optic)
    if options is None or not options.annulus:
        return []
    faces = _last_faces(system)
    small = int(faces[1][0].half_width < faces[0][0].half_width)
    surface, vertex, freedom = faces[small]
    side, level = 2 * small - 1, options.land
    if level is None:
        rim = np.array([(min(surface.half_width), 0.0), *rim_around(surface)])  # the nearest and the farthest
        outermost = float((side * surface.conic(*rim.T)).max())
        level = vertex + side * (outermost + freedom + LAND_STEP)
    return [(faces[1 - small][0], level)]


def _around(surface: FreeformSurface, vertex: float, freedom: float) -> Floats:
    """Return points whose convex hull holds a surface with its freedom, (n, 3).

    A conic lies on one side of its tangent planes, here those at the middles of cells.  It lies on the other
    side of the hull of its points at the corners of a polygon around its outline: its height is convex for
    positive radii and concave for negative ones.
    """
    inward = 1.0 if surface.conic.radius > 0 else -1.0
    rim = rim_around(surface)[::-1]
    x, y, corners = _grid(surface) if surface.outline.is_rectangle else _fan(rim, surface.half_width)
    height, along_x, along_y = (surface.conic(x, y, d) for d in ((0, 0), (1, 0), (0, 1)))
    found = []
    for k, (dx, dy) in enumerate(corners):
        tangent = vertex + height + dx * along_x + dy * along_y - inward * freedom
        at = np.broadcast_arrays(x + dx, y + dy, tangent)
        found.append(np.stack([c.ravel() for c in at], axis=1))
        on_rim = rim[k :: len(corners)]
        found.append(np.column_stack([on_rim, vertex + surface.conic(*on_rim.T) + inward * freedom]))
    return np.concatenate(found)


def rim_around(surface: FreeformSurface) -> Floats:
    """Return the corners of a polygon around a surface's outline, within its rectangle, (n, 2) mm."""
    if surface.outline.is_rectangle:
        return np.multiply(SIGNS, surface.half_width)
    return surface.outline.circumscribed(SIDES)


def _grid(surface: FreeformSurface) -> tuple[Floats, Floats, Offsets]:
    """Return cells of a rectangle: x and y of their middles, which broadcast, and offsets of the corners."""
    x, y = (h * (2 * np.arange(CELLS + 1) / CELLS - 1) for h in surface.half_width)
    a, b = (h / CELLS for h in surface.half_width)
    middle = (x[1:] + x[:-1])[:, None] / 2, (y[1:] + y[:-1])[None, :] / 2
    return *middle, [(i * a, j * b) for i, j in SIGNS[::-1]]


def _fan(rim: Floats, half_width: tuple[float, float]) -> tuple[Floats, Floats, Offsets]:
    """Return the same of a polygon: cells between rays from its middle, about as wide as those of `_grid`.

    rim : (n, 2), the corners of the polygon in order, mm
    """
    ahead = np.roll(rim, -1, axis=0) - rim
    pieces = np.ceil(CELLS / 2 * np.hypot(*(ahead / half_width).T)).astype(int)
    share = np.concatenate([np.arange(n) / n for n in pieces])[:, None]
    start = np.repeat(rim, pieces, axis=0) + share * np.repeat(ahead, pieces, axis=0)
    out = np.linspace(0, 1, (CELLS + 1) // 2 + 1)[:, None, None]
    corners = [r * p for r in (out[:-1], out[1:]) for p in (start, np.roll(start, -1, axis=0))]
    middle = sum(corners) / 4
    return middle[..., 0], middle[..., 1], [((c - middle)[..., 0], (c - middle)[..., 1]) for c in corners]


def points_within(system: System) -> Floats:
    """Return points of all last elements: of their faces at both ends of z_freedom, (n, 3) mm."""
    at, points = np.linspace(-1, 1, SAMPLES), []
    ends = [(face, vertex + i * freedom, 1) for face, vertex, freedom in _last_faces(system) for i in (-1, 1)]
    for surface, z, curved in [*ends, *((face, z, 0) for face, z in _land(system))]:
        x, y = np.meshgrid(*(h * at for h in surface.half_width))
        if not surface.outline.is_rectangle:
            x, y = surface.outline.filled(x, y)
        points.append(np.stack([x, y, z + curved * surface.conic(x, y)], axis=-1).reshape(-1, 3))
    return np.concatenate(points)
