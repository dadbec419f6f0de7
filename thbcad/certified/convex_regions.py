"""Convex regions of space as half-spaces, and what lies beyond them.

A figure of the plane is held between parallel lines in `DIRECTIONS`: its supports h_k are the greatest
d_k . (x, y).  The region between two such figures at two heights holds every straight path from the one to
the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thbcad.checks import Bools, Floats
from thbcad.outlines import Outline

_ANGLES = np.arange(64) * (2 * np.pi / 64)
DIRECTIONS: Floats = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1).round(15)
FLAT = 1e-12  # relative: differences of heights that count as none


@dataclass(frozen=True, eq=False)
class Stack:
    """Convex figures at heights, the i-th one {d_k . (x, y) <= supports[i, k]} at z = heights[i], mm."""

    heights: Floats
    supports: Floats

    @classmethod
    def around(cls, points: Floats) -> Stack:
        """Return a stack that holds points, (3, n) mm."""
        supports = supports_of(points[:2].T)
        return cls(np.array([points[2].min(), points[2].max()]), np.array([supports, supports]))

    def towards(self, other: Stack, z: float) -> Stack:
        """Return a figure at a height between two stacks that holds where straight paths from the one to the
        other cross it."""
        share = (z - self.heights[:, None]) / (other.heights - self.heights[:, None])
        mixed = (1 - share)[..., None] * self.supports[:, None] + share[..., None] * other.supports
        return Stack(np.array([z]), mixed.max(axis=(0, 1))[None])


@dataclass(frozen=True, eq=False)
class ConvexRegion:
    """The points X with normals @ X <= offsets.  normals : (m, 3) unit vectors.  offsets : (m,) mm."""

    normals: Floats
    offsets: Floats

    def shrunk(self, depth: float) -> ConvexRegion:
        """Return the points that lie deeper in it than a depth, mm."""
        return ConvexRegion(self.normals, self.offsets - depth)

    def misses(self, nets: Floats) -> Bools:
        """Return for each of n sets of points, (n, k, 3), whether one half-space shuts all of them out, (n,).

        Their convex hull then lies outside.
        """
        return np.asarray(((nets @ self.normals.T).min(axis=1) >= self.offsets).any(axis=1))

    def holds(self, points: Floats) -> Bools:
        """Return which of the points (n, 3) lie inside."""
        return np.asarray((points @ self.normals.T < self.offsets).all(axis=1))

    def part_of_line(self, start: Floats, stop: Floats) -> Floats:
        """Return the ends of what a line from start to stop has inside, (2, 3), or (0, 3)."""
        at_start, at_stop = (self.normals @ point - self.offsets for point in (start, stop))
        slope = at_stop - at_start
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -at_start / slope
        low = max(0.0, crossing[slope < 0].max(initial=0.0))
        high = min(1.0, crossing[slope > 0].min(initial=1.0))
        if (at_start[slope == 0] >= 0).any() or not low < high:
            return np.empty((0, 3))
        return start + np.array([[low], [high]]) * (stop - start)

    def section(self, origin: Floats, across: Floats, along: Floats, reach: float) -> Floats:
        """Return the corners of its section with a plane, (n, 3), none where they do not meet.

        across, along : (3,) orthogonal unit vectors of the plane.  reach : mm from its origin, at most.
        """
        polygon = reach * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
        flat = np.stack([self.normals @ across, self.normals @ along], axis=1)
        limits = self.offsets - self.normals @ origin
        for normal, limit in zip(flat, limits):
            beyond = polygon @ normal - limit
            if (beyond < 0).all():
                continue
            following, after = np.roll(polygon, -1, axis=0), np.roll(beyond, -1)
            cut = (beyond < 0) != (after < 0)
            share = np.where(cut, beyond / np.where(cut, beyond - after, 1.0), 0.0)
            between = polygon + share[:, None] * (following - polygon)
            both = np.stack([polygon, between], axis=1).reshape(-1, 2)
            polygon = both[np.stack([beyond < 0, cut], axis=1).ravel()]
            if len(polygon) < 3:
                return np.empty((0, 3))
        return origin + polygon @ np.stack([across, along])


def region_between(one: Stack, other: Stack) -> ConvexRegion:
    """Return a region that holds all straight paths from one stack to another.

    In every direction d_k it is bounded by the lines h(z) of the upper convex hull of all (z, h_k), each
    moved outward until it bounds all of them.
    """
    z = np.concatenate([one.heights, other.heights])
    h = np.concatenate([one.supports, other.supports])
    rows, limits = [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)], [z.max(), -z.min()]
    for direction, supports in zip(DIRECTIONS.tolist(), h.T):
        for slope in {0.0, *_slopes(z, supports)}:
            size = np.hypot(1.0, slope)
            rows.append((direction[0] / size, direction[1] / size, -slope / size))
            limits.append((supports - slope * z).max() / size)
    return ConvexRegion(np.array(rows), np.array(limits))


def _slopes(z: Floats, h: Floats) -> list[float]:
    """Return the slopes of the upper convex hull of points (z, h), by gift wrapping."""
    slopes = []
    least = FLAT * float(np.abs(z).max())
    at = np.lexsort((-h, z))[0]
    while (ahead := np.flatnonzero(z > z[at] + least)).size:
        steep = (h[ahead] - h[at]) / (z[ahead] - z[at])
        at = ahead[np.lexsort((-z[ahead], -steep))[0]]
        slopes.append(float(steep.max()))
    return slopes


def supports_of(points: Floats) -> Floats:
    """Return the supports of points (x, y), (n, 2)."""
    return np.asarray((points @ DIRECTIONS.T).max(axis=0))


def rectangle_supports(half_width: tuple[float, float]) -> Floats:
    """Return the supports of a rectangle round the origin, mm."""
    return np.abs(DIRECTIONS) @ half_width


def ellipse_supports(half_width: tuple[float, float]) -> Floats:
    """Return the supports of the ellipse in such a rectangle."""
    return np.asarray(np.linalg.norm(DIRECTIONS * half_width, axis=1))


def outline_supports(outline: Outline) -> Floats:
    """Return the supports of an outline: of the rectangle of the middles of its corners, and of a corner."""
    straight = np.subtract(outline.half_width, outline.corners)
    return np.asarray(rectangle_supports((straight[0], straight[1])) + ellipse_supports(outline.corners))
