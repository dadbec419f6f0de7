"""How much of the light's way to every pixel the last element can fill: the silhouette of its envelope.

All light of the path leaves the last element of a row, and so comes from the convex hull B of its envelope
(`etendue.envelope`), in the frame of the target.  A point x of the target sees B under the projected solid
angle

    P(x) = integral of cos(theta) dOmega = 1/2 sum over edges of angle(a, b) (a x b)_z / |a x b|

over the edges of its silhouette, with a and b from x to the ends of an edge (Lambert).

A pixel gets the mean of P over its points x = c + delta.  With the tangents u of directions, w = (1 + u^2)^-2
and the depth d of a point of B below the target,

    P(x) = integral of w(u) du over U(x) = {(b - x) / d : b in B},    U(x) = U' - delta / m,

where U' is what c sees of B sheared by delta (d / m - 1), that is (b - c) / d + delta (1 / m - 1 / d), with m
the harmonic mean of the least and the greatest depth.  So U' lies in the view from c of the hull of B sheared
to the four corners of the pixel.  For a fixed u the mean of w at u - delta / m and at u + delta / m is below
w(u) R with

    R = (1 + T) / (1 - T)^2,    T = (2 |u| / (1 + u^2))^2 |delta|^2 / m^2.

Hence mean P <= R P_c(sheared hull): both errors are those of half a pixel and vanish with it, and pixels are
divided into equal parts where there is time.

In the far field the area A of B's shadow stands for P, with dA = sum of A_f max(0, N_f v) over the faces,
convex in v = (tan u, tan v, 1): greatest at a corner of a part of a pixel.

Source: J. H. Lambert, Photometria (1760); J. R. Howell, A Catalog of Radiation Heat Transfer Configuration
Factors, for polygons.
"""

from __future__ import annotations

from math import ceil, hypot, isqrt, pi

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from optics.designing.etendue.envelope import SIGNS, envelope, points_within
from optics.scene.receivers import Screen
from optics.scene.system import System, pose_of
from thbcad.checks import Floats
from thbcad.poses import IDENTITY, Pose

PART = 1 / 32  # of the least depth, the side of a part of a pixel: P is then 1 or 2 % too large
POINTS = 1 << 18  # parts of pixels on a target, at most: below a second
NODES, LOOKED_AT = 3, 8  # each way: in a pixel, pixels on the target
OUTWARD = 1 + 1e-6  # the rounding of P is about EPS times distance over size, 1e-8 in the extreme


def pixel_etendue(system: System) -> Floats:
    """Return an upper bound of the etendue between the envelope and every pixel, (rows, columns) mm^2 sr."""
    (pose, z), screen = _before_target(system), system.target.screen()
    points = _moved(envelope(system), pose)
    depth = 180 / pi if screen.angular else z - points[:, 2].max()
    # into how many parts a pixel is divided in each direction
    affordable = isqrt((POINTS if system.axial else POINTS // 4) // (screen.pixels[0] * screen.pixels[1]))
    parts = max(1, ceil(min(max(screen.pitch) / (PART * depth), affordable))) if depth > 0 else 1
    fine = screen.finer(parts)
    if screen.angular:
        part = _shadow(fine, points) * _solid_angle(fine)
    else:
        part = _seen(fine, points, z, system.axial) * fine.pixel_area
    rows, columns = screen.shape
    return OUTWARD * part.reshape(rows, parts, columns, parts).sum(axis=(1, 3))


def _before_target(system: System) -> tuple[Pose, float]:
    """Return the pose of the last element in a frame whose z goes through the target, and the target's z."""
    receiver = system.target.receiver
    if system.axial:
        return IDENTITY, float(receiver.pose.shift[2])
    return receiver.pose.inverse() @ pose_of(system.problem.faces_met[-1].optic), 0.0


def _moved(points: Floats, pose: Pose) -> Floats:
    """Return points elsewhere, (n, 3)."""
    return np.asarray(pose.points(points.T)).T


def _seen(screen: Screen, points: Floats, z: float, mirrored: bool = True) -> Floats:
    """Return an upper bound of the mean of P over every pixel of a target plane, (rows, columns) sr.

    mirrored : the envelope is its own mirror image in x and in y: a quarter of the pixels tells all.
    """
    depth = z - points[:, 2]
    nearest, farthest = depth.min(), depth.max()
    if nearest <= 0:
        return np.full(screen.shape, pi)
    middle = 2 / (1 / nearest + 1 / farthest)
    shear = np.outer(depth / middle - 1, np.array(screen.pitch) / 2)
    swept = np.concatenate([points + np.pad(shear * sign, ((0, 0), (0, 1))) for sign in SIGNS])
    told = [np.abs(a)[: (len(a) + 1) // 2] if mirrored else a for a in screen.centres]
    x, y = (a.ravel() for a in np.meshgrid(*told))
    sides = list(zip((x, y), swept[:, :2].min(axis=0), swept[:, :2].max(axis=0)))
    least = np.hypot(*(np.maximum(np.maximum(low - a, a - high), 0.0) for a, low, high in sides)) / farthest
    most = np.hypot(*(np.maximum(a - low, high - a) for a, low, high in sides)) / nearest
    u = np.clip(1.0, least, most)
    t = (u / (1 + u * u) * hypot(*screen.pitch) / middle) ** 2
    spread = np.divide(1 + t, (1 - t) ** 2, out=np.full_like(t, np.inf), where=t < 1)
    bound = np.minimum(projected_solid_angle(swept, x, y, z) * spread, pi)
    bound = bound.reshape(len(told[1]), -1)
    if not mirrored:
        return bound
    rows, columns = (np.minimum(np.arange(n), np.arange(n)[::-1]) for n in screen.shape)
    return bound[np.ix_(rows, columns)]


def projected_solid_angle(points: Floats, x: Floats, y: Floats, z: float) -> Floats:
    """Return P of the convex hull of `points` (n, 3), seen from (x, y, z) above all of them, (m,) sr."""
    try:
        hull = ConvexHull(points)
    except QhullError:  # of a thin face many are almost the same; QJ moves them apart, by 1e-11 of their size
        hull = ConvexHull(points, qhull_options="QJ")
    visible = [(plane[0] * x + plane[1] * y + (plane[2] * z + plane[3])) > 0 for plane in hull.equations]
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


def _edge_term(a: Floats, b: Floats) -> Floats:
    """Return angle(a, b) (a x b)_z / |a x b| / 2 of vectors (3, n)."""
    normal = np.cross(a, b, axis=0)
    length = np.sqrt((normal**2).sum(axis=0))
    angle = np.arctan2(length, (a * b).sum(axis=0))
    return np.divide(angle * normal[2], 2 * length, out=np.zeros_like(length), where=length > 0)


def _shadow(screen: Screen, points: Floats) -> Floats:
    """Return an upper bound of the shadow's area over every pixel of the far field, (rows, columns) mm^2."""
    a, b = _tangents(screen)
    area = _thrown(points, a[None, :], b[:, None])
    corner = np.maximum(area[1:], area[:-1])
    least = [np.where(t[1:] * t[:-1] > 0, np.minimum(np.abs(t[1:]), np.abs(t[:-1])), 0.0) for t in (a, b)]
    length = np.sqrt(1 + least[0][None, :] ** 2 + least[1][:, None] ** 2)
    return np.maximum(corner[:, 1:], corner[:, :-1]) / length


def _thrown(points: Floats, a: Floats, b: Floats) -> Floats:
    """Return the area of the shadow along (a, b, 1) on a plane z = constant, mm^2; a and b broadcast."""
    hull = ConvexHull(points)
    area = np.zeros(np.broadcast_shapes(a.shape, b.shape))
    for plane, corners in zip(hull.equations, hull.simplices):
        p, q, r = points[corners]
        size = np.linalg.norm(np.cross(q - p, r - p)) / 2
        area += size * np.maximum(plane[0] * a + plane[1] * b + plane[2], 0.0)
    return area


def _solid_angle(screen: Screen) -> Floats:
    """Return the solid angle of every pixel of the far field, (rows, columns) sr."""
    a, b = _tangents(screen)
    corner = np.arctan(a[None, :] * b[:, None] / np.sqrt(1 + a[None, :] ** 2 + b[:, None] ** 2))
    return -np.diff(np.diff(corner, axis=0), axis=1)


def _tangents(screen: Screen) -> tuple[Floats, Floats]:
    """Return the tangents of the borders of columns and rows; those of rows fall."""
    a, b = (
        np.tan(np.radians(h * (2 * np.arange(n + 1) / n - 1)))
        for h, n in zip(screen.half_width, screen.pixels)
    )
    return a, -b


def greatest_slack(system: System, etendue: Floats) -> float:
    """Return how many times what the envelope fills a bound is, at most of pixels all over the target.

    The envelope is sampled from within, by points of its surfaces within their outlines.  Gauss's rule takes
    means over pixels.

    etendue : (rows, columns), mm^2 sr, the bound
    """
    (pose, z), screen = _before_target(system), system.target.screen()
    points = _moved(points_within(system), pose)
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    rows, columns = (np.unique(np.linspace(0, n - 1, LOOKED_AT).round().astype(int)) for n in screen.shape)
    along = (
        (centres[at, None] + pitch / 2 * nodes).ravel()
        for centres, at, pitch in zip(screen.centres, (columns, rows), screen.pitch)
    )
    x, y = np.meshgrid(*along)
    if screen.angular:
        a, b = np.tan(np.radians(x)), np.tan(np.radians(y))
        seen = _thrown(points, a, b) * (1 + a * a) * (1 + b * b) / (1 + a * a + b * b) ** 2
        seen *= (pi / 180) ** 2
    else:
        seen = projected_solid_angle(points, x.ravel(), y.ravel(), z)
    seen = seen.reshape(len(rows), NODES, len(columns), NODES)
    filled = np.einsum("injm,n,m->ij", seen, weights, weights) / 4 * screen.pixel_area
    return float((etendue[np.ix_(rows, columns)] / filled).max())
