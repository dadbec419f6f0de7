"""How much of the light's way to every pixel the lens can fill: the silhouette of its envelope.

The envelope holds every lens of a problem: conic +- z_freedom of front and rear, and the straight edges
between their rims.  Light comes from its convex hull B.  A point x of the target sees B under the projected
solid angle

    P(x) = integral of cos(theta) dOmega = 1/2 sum over edges of angle(a, b) (a x b)_z / |a x b|

over the edges of its silhouette, with a and b from x to the ends of an edge (Lambert).  In the far field the
area of B's shadow stands for P.

Pixels have extent.  Seen from x = c + delta instead of the centre c, a point of B at the depth d moves by
delta (1 - d0 / d) on the plane at the least depth d0, where the solid angle of an area element changes by
(|r| / |r + delta|)^4 at most.  So for all x of a pixel

    P(x) <= P_c(B + t pixel) / (1 - |delta| / r)^4,    t = (greatest depth - d0) / d0,

with the least distance r of c from B.  The shadow's area, sum of A_f max(0, N_f v) over the faces, is convex
in v = (tan u, tan v, 1): over a pixel it is greatest at a corner.

Source: J. H. Lambert, Photometria (1760); J. R. Howell, A Catalog of Radiation Heat Transfer Configuration
Factors, for polygons.
"""

from __future__ import annotations

from math import hypot, inf, pi
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from optics.problem import freedom_of

if TYPE_CHECKING:
    from optics.system import OpticalSystem
    from thbcad.lens import FreeformSurface

CELLS = 8  # of a surface in each direction, over which the height of its conic is enclosed
OUTWARD = 1 + 1e-6  # the rounding of P is about EPS times distance over size, 1e-8 in the extreme

Array = NDArray[np.float64]


def pixel_etendue(system: OpticalSystem) -> Array:
    """Return an upper bound of the etendue between the envelope and every pixel, (rows, columns) mm^2 sr."""
    points = envelope(system)
    if system.target.far_field:
        return OUTWARD * _shadow(system, points) * _solid_angle(system)
    screen = system.target.screen()
    return OUTWARD * _seen(system, points) * screen.pixel_area


def envelope(system: OpticalSystem) -> Array:
    """Return points whose convex hull holds every lens of a problem, (n, 3) mm; z_freedom must be known."""
    spec, lens = system.problem.lens, system.lens
    return np.concatenate(
        [
            _box_corners(lens.front, 0.0, freedom_of(spec.front)),
            _box_corners(lens.rear, lens.thickness, freedom_of(spec.rear)),
        ]
    )


def _box_corners(surface: FreeformSurface, vertex: float, freedom: float) -> Array:
    """Return the corners of boxes that hold a surface, one for each cell, (n, 3).

    The height of a conic is monotone in the distance from the axis.
    """
    x, y = (h * (2 * np.arange(CELLS + 1) / CELLS - 1) for h in surface.half_width)
    near, far = (
        [select(np.abs(a[:-1]), np.abs(a[1:])) for a in (x, y)] for select in (np.minimum, np.maximum)
    )
    ends = [surface.conic(a[:, None], b[None, :]) for a, b in (near, far)]
    corners = []
    for height in (np.minimum(*ends) - freedom, np.maximum(*ends) + freedom):
        for i in (slice(0, -1), slice(1, None)):
            for j in (slice(0, -1), slice(1, None)):
                at = np.broadcast_arrays(x[i, None], y[None, j], vertex + height)
                corners.append(np.stack([a.ravel() for a in at], axis=1))
    return np.concatenate(corners)


def _seen(system: OpticalSystem, points: Array) -> Array:
    """Return an upper bound of P over every pixel of a target plane, (rows, columns) sr."""
    screen, z = system.target.screen(), system.target.z
    nearest, farthest = z - points[:, 2].max(), z - points[:, 2].min()
    half = np.array(screen.pitch) / 2 * (farthest - nearest) / nearest
    shifts = half * [[1, 1], [1, -1], [-1, 1], [-1, -1]]
    swept = np.concatenate([points + np.append(shift, 0.0) for shift in shifts])
    # the envelope is its own mirror image in x and in y: a quarter of the pixels tells all
    quarter = [np.abs(a)[: (len(a) + 1) // 2] for a in screen.centres]
    x, y = (a.ravel() for a in np.meshgrid(*quarter))
    aside = [np.maximum(np.abs(a) - np.abs(points[:, k]).max(), 0.0) for k, a in enumerate((x, y))]
    distance = np.sqrt(aside[0] ** 2 + aside[1] ** 2 + nearest**2)
    left = np.maximum(1 - hypot(*screen.pitch) / 2 / distance, 0.0) ** 4
    seen = projected_solid_angle(swept, x, y, z)
    bound = np.divide(seen, left, out=np.full_like(seen, inf), where=left > 0)
    rows, columns = (np.minimum(np.arange(n), np.arange(n)[::-1]) for n in screen.shape)
    return np.minimum(bound, pi).reshape(len(quarter[1]), -1)[np.ix_(rows, columns)]


def projected_solid_angle(points: Array, x: Array, y: Array, z: float) -> Array:
    """Return P of the convex hull of `points` (n, 3), seen from (x, y, z) above all of them, (m,) sr."""
    hull = ConvexHull(points)
    visible = [_side(plane, x, y, z) > 0 for plane in hull.equations]
    total = np.zeros_like(x)
    for face, (corners, neighbours) in enumerate(zip(hull.simplices, hull.neighbors)):
        for k, other in enumerate(neighbours):
            at = np.flatnonzero(visible[face] & ~visible[other])
            if len(at):
                i, j = np.delete(corners, k)
                # the face lies to the left of the edge seen from outside
                turn = np.linalg.det(
                    [points[j] - points[i], points[corners[k]] - points[i], hull.equations[face, :3]]
                )
                ends = (points[i], points[j]) if turn > 0 else (points[j], points[i])
                total[at] += _edge_term(
                    *(e[:, None] - np.array([x[at], y[at], np.full(len(at), z)]) for e in ends)
                )
    return np.maximum(total, 0.0)


def _side(plane: Array, x: Array, y: Array, z: float) -> Array:
    return plane[0] * x + plane[1] * y + (plane[2] * z + plane[3])


def _edge_term(a: Array, b: Array) -> Array:
    """Return angle(a, b) (a x b)_z / |a x b| / 2 of vectors (3, n)."""
    normal = np.cross(a, b, axis=0)
    length = np.sqrt((normal**2).sum(axis=0))
    angle = np.arctan2(length, (a * b).sum(axis=0))
    return np.divide(angle * normal[2], 2 * length, out=np.zeros_like(length), where=length > 0)


def _shadow(system: OpticalSystem, points: Array) -> Array:
    """Return an upper bound of the shadow's area over every pixel of the far field, (rows, columns) mm^2."""
    hull = ConvexHull(points)
    a, b = _tangents(system)
    area = np.zeros((len(b), len(a)))
    for plane, corners in zip(hull.equations, hull.simplices):
        p, q, r = points[corners]
        size = np.linalg.norm(np.cross(q - p, r - p)) / 2
        area += size * np.maximum(plane[0] * a[None, :] + plane[1] * b[:, None] + plane[2], 0.0)
    corner = np.maximum(area[1:], area[:-1])
    least = [np.where(t[1:] * t[:-1] > 0, np.minimum(np.abs(t[1:]), np.abs(t[:-1])), 0.0) for t in (a, b)]
    length = np.sqrt(1 + least[0][None, :] ** 2 + least[1][:, None] ** 2)
    return np.maximum(corner[:, 1:], corner[:, :-1]) / length


def _solid_angle(system: OpticalSystem) -> Array:
    """Return the solid angle of every pixel of the far field, (rows, columns) sr."""
    a, b = _tangents(system)
    corner = np.arctan(a[None, :] * b[:, None] / np.sqrt(1 + a[None, :] ** 2 + b[:, None] ** 2))
    return -np.diff(np.diff(corner, axis=0), axis=1)


def _tangents(system: OpticalSystem) -> tuple[Array, Array]:
    """Return the tangents of the borders of columns and rows; those of rows fall."""
    screen = system.target.screen()
    a, b = (
        np.tan(np.radians(h * (2 * np.arange(n + 1) / n - 1)))
        for h, n in zip(screen.half_width, screen.pixels)
    )
    return a, -b
