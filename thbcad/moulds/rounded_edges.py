"""What rounded edges take away of the faces of a body: what the ball of their radius, which rolls along wall
and surface, does not reach."""

import numpy as np

from thbcad.checks import Bools, Floats, Integers
from thbcad.lens import FreeformSurface
from thbcad.moulds.drafted_walls import DraftedWall
from thbcad.moulds.moulded_body import MouldedBody

STEP = 1e-5  # mm, of differences of distances, which are smooth there
STEPS = 12  # of Newton's method, from a point about a radius away: more than double precision needs
ON_WALL = 1e-6  # mm


def rounded_off(body: MouldedBody, points: Floats, faces: Integers) -> Bools:
    """Return which points of the faces of a body lie where its rounded edges take them away.

    A point of the surface is taken where the ball that touches it there reaches through the wall, a point of
    the wall where its ball reaches through the surface.

    points : (3, n), mm, of the body with sharp edges.  faces : (n,), 0 of the front, 1 of the rear, else of
        others.
    """
    taken = np.zeros(len(faces), dtype=bool)
    for k in body.rounded:
        surface, vertex = ((body.lens.front, 0.0), (body.lens.rear, body.lens.thickness))[k]
        wall, side = body.walls[k], 2 * k - 1
        on = np.flatnonzero(faces == k)
        x, y, _ = points[:, on]
        normal = side * np.array([-surface(x, y, (1, 0)), -surface(x, y, (0, 1)), np.ones_like(x)])
        centre = points[:, on] - body.edge_radius * normal / np.linalg.norm(normal, axis=0)
        taken[on] = wall.beside(*centre) > -body.edge_radius
        on = np.flatnonzero((faces > 1) & (abs(wall.beside(*points)) <= ON_WALL))
        on = on[side * (points[2, on] - wall.level) > 0]
        centre = points[:, on] - body.edge_radius * _outward(wall, points[:, on])
        taken[on] = _distance(surface, vertex, centre) < body.edge_radius
    return taken


def _outward(wall: DraftedWall, points: Floats) -> Floats:
    """Return unit normals of a wall, (3, n)."""
    steps = STEP * np.eye(3)[:, :, None]
    rise = np.array([wall.beside(*(points + step)) - wall.beside(*(points - step)) for step in steps])
    normals: Floats = rise / np.linalg.norm(rise, axis=0)
    return normals


def _distance(surface: FreeformSurface, vertex: float, points: Floats) -> Floats:
    """Return the distances of points from a surface, mm: with the gap g = z(x, y) - c_z Newton's method finds
    (x - c_x) + g z_x = (y - c_y) + g z_y = 0."""
    (hx, hy), (cx, cy, cz) = surface.half_width, points
    x, y = cx, cy
    for _ in range(STEPS):
        gap = vertex + surface(x, y) - cz
        zx, zy = surface(x, y, (1, 0)), surface(x, y, (0, 1))
        f, g = x - cx + gap * zx, y - cy + gap * zy
        a = 1 + zx * zx + gap * surface(x, y, (2, 0))
        b = zx * zy + gap * surface(x, y, (1, 1))
        c = 1 + zy * zy + gap * surface(x, y, (0, 2))
        determinant = a * c - b * b
        x = np.clip(x - (c * f - b * g) / determinant, -hx, hx)
        y = np.clip(y - (a * g - b * f) / determinant, -hy, hy)
    distances: Floats = np.linalg.norm([x - cx, y - cy, vertex + surface(x, y) - cz], axis=0)
    return distances
