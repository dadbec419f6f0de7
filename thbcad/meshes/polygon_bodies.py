"""Watertight meshes of a lens that is cut to a polygon, with a proven chord error.

The polygon is cut into triangles ear by ear, the ear with the shortest diagonal first.  Then every side that
is longer than h is halved, until there is none.  A triangle with sides of at most h lies within a circle of
radius R = h / sqrt(3), hence h^2 = 6 e / M keeps the error e = M R^2 / 2 of `plans`.  As a side is halved or
not for both of its triangles, the mesh has no gaps.  Walls are plane, with triangles from rim to rim.

Source: G. H. Meisters, Polygons have ears, Amer. Math. Monthly 82 (1975) 648.
"""

import numpy as np

from thbcad.checks import EPS, Bools, Floats, Integers
from thbcad.lens import MOST_TRIANGLES, Lens, Tessellation, require_polygon, told_apart, walled_triangles
from thbcad.meshes.plans import bounds_of, least_circles, on_surfaces, too_many
from thbcad.outlines import Polygon

ROUNDINGS = 16  # of a turn's two products of differences of coordinates, each up to (2 m)^2 eps for |x| <= m
# Triangles that replace one: 0, 1, 2 are its corners, 3, 4, 5 the middles of its sides from corner 0, 1, 2.
ONE_HALVED = ((0, 3, 2), (3, 1, 2))  # side 0
TWO_HALVED = (  # sides 0 and 1; which line cuts the rest: to the middle of side 0, or of side 1
    ((3, 1, 4), (0, 3, 2), (3, 4, 2)),
    ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
)
THREE_HALVED = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))


def polygon_mesh(lens: Lens, chord: float, corners: object, single: bool = False) -> Tessellation:
    """Return a mesh of a lens that is cut to a polygon; its faces are front, rear, edge 1, edge 2, ...

    lens : a sound one.  chord : mm, the error that it may have.  single : round the vertices to float32.
    """
    polygon = require_polygon(lens, corners)
    bounds = bounds_of(lens, float(np.abs(polygon.corners).max()), (lens.front.outline, lens.rear.outline))
    added = bounds.rounding(single)
    if added >= chord:
        raise ValueError(f"chord must be greater than {added:.2g} mm, by which rounding moves vertices")
    longest = np.sqrt(6 * (chord - added) / bounds.bend) if bounds.bend else np.inf
    if 2 * polygon.area > MOST_TRIANGLES * longest**2 * 3**0.5 / 4:  # even of equilateral ones
        raise too_many(chord)
    positions, plan = _refined(np.array(polygon.corners), ears(polygon), longest, chord)
    circles = least_circles(*(positions[plan[:, k]] for k in range(3)))
    bound = bounds.bend * float(circles.max()) / 2
    ring = _rim(plan)
    triangles = walled_triangles(plan, ring, len(positions), 1)
    vertices = told_apart(np.concatenate(on_surfaces(lens, positions, positions)), triangles, single)
    count = len(polygon.corners)
    sides = np.cumsum(ring < count) - 1  # corners have the first numbers, in their order
    faces = np.concatenate([np.repeat([0, 1], len(plan)), 2 + np.repeat(sides, 2)])
    names = ("front", "rear", *(f"edge {k + 1}" for k in range(count)))
    return Tessellation(vertices, triangles, faces, bound + added, names)


def ears(polygon: Polygon) -> Integers:
    """Return the numbers of the corners of triangles that fill a polygon, (n - 2, 3), counter-clockwise.

    A corner that rounding does not tell from the border of an ear lies in it.  Corners on a straight side
    would otherwise be cut off from the rest, and leave a strip without area.
    """
    corners = np.array(polygon.corners)
    flat = ROUNDINGS * EPS * float(np.square(corners).max())
    left = np.arange(len(corners))
    triangles = []
    while len(left) > 3:
        before, after = corners[np.roll(left, 1)], corners[np.roll(left, -1)]
        convex = _turn(before, corners[left], after) > flat
        lengths = np.where(convex, np.hypot(*(after - before).T), np.inf)
        order = np.argsort(lengths, kind="stable")[: int(convex.sum())]
        ear = next((int(k) for k in order if _is_ear(corners, left, int(k), flat)), None)
        if ear is None:
            raise ValueError("the polygon has corners that rounding does not tell apart; leave some out")
        triangles.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        left = np.delete(left, ear)
    return np.array([*triangles, left])


def _is_ear(corners: Floats, left: Integers, k: int, flat: float) -> bool:
    """Return whether no other corner lies in the triangle of a convex corner and its neighbours.

    flat : twice the area of triangles that may be none.
    """
    own = left[[k - 1, k, (k + 1) % len(left)]]
    a, b, c = corners[own]
    others = corners[np.setdiff1d(left, own, assume_unique=True)]
    sides = ((a, b), (b, c), (c, a))
    return not np.all([_turn(start, stop, others) >= -flat for start, stop in sides], axis=0).any()


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return twice the area of triangles, positive where they run counter-clockwise."""
    u, v = b - a, c - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _refined(positions: Floats, plan: Integers, longest: float, chord: float) -> tuple[Floats, Integers]:
    """Return positions and triangles with no side longer than `longest`, made by halving sides."""
    while True:
        steps = positions[np.roll(plan, -1, axis=1)] - positions[plan]
        lengths = np.hypot(steps[..., 0], steps[..., 1])
        long = lengths > longest
        if not long.any():
            return positions, plan
        if 2 * (len(plan) + int(long.sum())) > MOST_TRIANGLES:  # front and rear
            raise too_many(chord)
        positions, plan = _halved(positions, plan, lengths, long)


def _halved(positions: Floats, plan: Integers, lengths: Floats, long: Bools) -> tuple[Floats, Integers]:
    """Return positions and triangles after the long sides are halved; lengths, long : (t, 3), of side k from
    corner k."""
    codes = np.sort(np.stack([plan, np.roll(plan, -1, axis=1)]), axis=0)
    sides, numbers = np.unique(codes[0][long] * len(positions) + codes[1][long], return_inverse=True)
    middles = np.full_like(plan, -1)
    middles[long] = len(positions) + numbers.ravel()
    ends = positions[np.stack(np.divmod(sides, len(positions)))]
    count = long.sum(axis=1)
    pieces = [plan[count == 0]]
    for many in (1, 2, 3):
        rows = np.flatnonzero(count == many)
        # the halved sides come first
        first = (np.argmin(long[rows], axis=1) + 1) % 3 if many == 2 else np.argmax(long[rows], axis=1)
        turn = (first[:, None] + np.arange(3)) % 3
        corners = np.hstack([np.take_along_axis(own[rows], turn, axis=1) for own in (plan, middles)])
        along = np.take_along_axis(lengths[rows], turn, axis=1)
        if many == 2:  # a line to the middle of the longer side is shorter than that side
            second = along[:, 1] > along[:, 0]
            pieces += [corners[~second][:, TWO_HALVED[0]], corners[second][:, TWO_HALVED[1]]]
        else:
            pieces.append(corners[:, ONE_HALVED if many == 1 else THREE_HALVED])
    refined = np.concatenate([piece.reshape(-1, 3) for piece in pieces])
    return np.concatenate([positions, ends.mean(axis=0)]), refined


def _rim(plan: Integers) -> Integers:
    """Return the numbers of the points on the rim of a plan, from corner 0 on, counter-clockwise."""
    start, stop = plan.ravel(), np.roll(plan, -1, axis=1).ravel()
    size = int(plan.max()) + 1
    outer = ~np.isin(start * size + stop, stop * size + start)
    following = dict(zip(start[outer].tolist(), stop[outer].tolist()))
    ring = [0]
    while (point := following[ring[-1]]) != 0:
        ring.append(point)
    return np.array(ring)
