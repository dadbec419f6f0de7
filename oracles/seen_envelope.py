"""The etendue between all lenses of a problem and a pixel, by dense sampling, from below.

Points of front and rear at both ends of z_freedom lie in the convex hull of all lenses.  From x their
tangents u = (b - x) / d span a convex polygon, and its projected solid angle is that of Lambert's polygon.
In the far field the points throw a polygon of the area A along (a, b, 1) on a plane across the axis, and
light from it has the etendue A da db / (1 + a^2 + b^2)^2.  Gauss's rule takes the mean over the pixel.  No
silhouette of a body in space is looked for, and nothing is enclosed.

A mirror anywhere before a target anywhere is sampled by its face alone, in the frame of the target.

Source: J. H. Lambert, Photometria (1760).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

SAMPLES = 256  # of a surface, each way: 64^3 points on the four ends of two surfaces
NODES = 6  # of Gauss's rule over a pixel, each way


def sampled_lenses(system, samples=SAMPLES):
    """Return the corners of the hull of 4 samples^2 points of all lenses, (n, 3) mm."""
    lens, freeforms, at = system.base, system.problem.lens.free, np.linspace(-1, 1, samples)
    points = []
    for side, vertex in (("front", 0.0), ("rear", lens.thickness)):
        surface = getattr(lens, side)
        x, y = places(surface.half_width, surface.outline.corners, at)
        freedom = freeforms[side].freedom if side in freeforms else 0.0
        for shift in {-freedom, freedom}:
            points.append(np.stack([x, y, vertex + surface.conic(x, y) + shift], axis=-1).reshape(-1, 3))
    points = np.concatenate(points)
    return points[ConvexHull(points).vertices]


def sampled_faces(system, samples=SAMPLES):
    """Return the corners of the hull of 2 samples^2 points of all faces of the last mirror, (n, 3) mm."""
    problem, at = system.problem, np.linspace(-1, 1, samples)
    mirror, target = problem.element[-1], problem.target
    half = mirror.face.half_width
    x, y = places(half, half if mirror.outline in ("round", "ellipse") else (0.0, 0.0), at)
    radius, constant = mirror.face.radius, mirror.face.conic
    r2 = x * x + y * y
    z = r2 / radius / (1 + np.sqrt(1 - (1 + constant) * r2 / radius**2))
    freedom = mirror.face.freeform.z_freedom if mirror.face.freeform else 0.0
    own = np.concatenate([np.stack([x, y, z + s], axis=-1).reshape(-1, 3) for s in {-freedom, freedom}])
    scene = Rotation.from_euler("XYZ", mirror.tilt, degrees=True).apply(own) + mirror.position
    middle = np.zeros(3) if target.far_field else np.array(target.position)
    points = Rotation.from_euler("XYZ", target.tilt, degrees=True).inv().apply(scene - middle)
    return points[ConvexHull(points).vertices] if freedom else points


def places(half_width, corners, at):
    """Return x and y of points of a surface: of a grid of its rectangle, and of the arcs of its rim.

    Its outline is a rectangle whose corners are quarters of ellipses.  at : from -1 to 1
    """
    x, y = (a.ravel() for a in np.meshgrid(*(h * at for h in half_width)))
    if not corners[0]:
        return x, y
    beyond = (np.maximum(abs(a) - (h - c), 0) / c for a, h, c in zip((x, y), half_width, corners))
    inside, turn = np.hypot(*beyond) <= 1, np.pi * at
    arcs = (
        np.copysign(h - c, wave) + c * wave
        for h, c, wave in zip(half_width, corners, (np.cos(turn), np.sin(turn)))
    )
    return [np.concatenate([a[inside], arc]) for a, arc in zip((x, y), arcs)]


def seen(points, x, y, z):
    """Return the projected solid angle of a convex hull seen from (x, y, z) above it, sr."""
    depth = z - points[:, 2]
    tangents = np.stack([(points[:, 0] - x) / depth, (points[:, 1] - y) / depth], axis=1)
    polygon = tangents[ConvexHull(tangents).vertices]  # counterclockwise
    a = np.column_stack([polygon, np.ones(len(polygon))])
    b = np.roll(a, -1, axis=0)
    normal = np.cross(a, b)
    length = np.linalg.norm(normal, axis=1)
    return float((np.arctan2(length, (a * b).sum(axis=1)) * normal[:, 2] / length).sum() / 2)


def sampled_etendue(system, pixels, points=None):
    """Return the etendue of pixels (row, column), mm^2 sr, from below up to the error of Gauss's rule."""
    points = sampled_lenses(system) if points is None else points
    screen = system.target.screen()
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    found = []
    for row, column in pixels:
        (px, py), x, y = screen.pitch, screen.centres[0][column], screen.centres[1][row]
        total = 0.0
        for i, first in zip(nodes, weights):
            for j, second in zip(nodes, weights):
                total += first * second / 4 * _at(system, points, x + i * px / 2, y + j * py / 2)
        found.append(total * px * py)
    return np.array(found)


def _at(system, points, x, y):
    """Return the etendue by area at a point of the target, sr; in the far field mm^2 sr / degree^2."""
    if not system.target.far_field:
        spec = system.problem.lens
        return seen(points, x, y, spec.thickness + system.problem.throw if spec else 0.0)
    a, b = np.tan(np.radians([x, y]))
    thrown = ConvexHull(points[:, :2] - np.outer(points[:, 2], [a, b])).volume
    return thrown * (1 + a * a) * (1 + b * b) / (1 + a * a + b * b) ** 2 * np.radians(1.0) ** 2
