"""What light meets behind a surface, up to the receiver, as one chart: where rays land, and where to aim.

Light leaves points along directions, meets fixed surfaces one after the other, and lands at (u, v).  Where
there are none the receiver itself is the chart.  Else `toward` solves landing(p, d) = (u, v) by Newton's
method with differences, from the direction from vertex to vertex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from optics.scene.paths import LightPath, Surface
from optics.scene.receivers import Receiver, Triple
from thbcad.checks import Bools, Floats
from thbcad.poses import IDENTITY, Pose
from thbcad.sags import Conic

NEWTON_STEPS = 8  # at most; steps double the digits: targets within reach need four or five
SETTLED = 1e-6  # rad: a step as short as that leaves no more than rounding of a landing
CHORD = 1e-3  # rad: behind shorter steps the derivatives hardly change, and each step adds three digits
FARTHEST = 0.3  # rad, of a step
DIFFERENCE = 1e-6  # rad: the square root of the rounding of a landing, with some room
BLOCK = 1 << 14  # rays at once, whose vectors stay in a cache: 2^18 of them take half of the seconds
AHEAD = 0.5  # cosine to the vertex: from directions farther aside Newton's method does not begin


@dataclass(frozen=True, eq=False)
class RestOfPath:
    """Fixed surfaces and a receiver, as a chart, in the frame of the surface before them.

    surfaces : conics, in the order in which light meets them.  indices : before, between and behind them.
    """

    surfaces: tuple[Surface, ...]
    indices: tuple[float, ...]
    receiver: Receiver

    @classmethod
    def behind(cls, path: LightPath, surface: int) -> RestOfPath:
        """Return what lies behind a surface.  surface : its number along the path."""
        path = path.seen_from(path.surfaces[surface].pose)
        indices = tuple(medium.index for medium in path.media[surface + 1 :])
        return cls(path.surfaces[surface + 1 :], indices, path.receiver)

    @cached_property
    def _into(self) -> Pose:
        """The motion into the frame of the first surface."""
        return self.surfaces[0].pose.inverse() if self.surfaces else IDENTITY

    @cached_property
    def _onward(self) -> tuple[Pose, ...]:
        """The motions into the frame of every surface from that of the one before it."""
        return IDENTITY, *(new.pose.inverse() @ old.pose for old, new in pairwise(self.surfaces))

    @cached_property
    def _screen(self) -> Receiver:
        """The receiver in the frame of the last surface."""
        return self.receiver.seen_from(self.surfaces[-1].pose) if self.surfaces else self.receiver

    def land(self, points: Triple, directions: Triple) -> tuple[Floats, Floats, Bools]:
        """Return u, v, and which rays come through to the receiver.  directions : unit vectors."""
        return self._landed(self._into.points(tuple(points)), self._into.directions(tuple(directions)))

    def _landed(self, points: Triple, along: Triple) -> tuple[Floats, Floats, Bools]:
        """Return what `land` returns, of points and unit vectors in the frame of the first surface."""
        through: Bools | bool = True
        for onward, surface, indices in zip(self._onward, self.surfaces, pairwise(self.indices)):
            points, along = onward.points(tuple(points)), onward.directions(tuple(along))
            points = met(surface.shape.conic, points, along)
            slopes = slopes_at(surface.shape.conic, points)
            along, passes = bent(surface.kind == "reflect", indices, along, slopes)
            through = through & passes & np.isfinite(points[2])
        with np.errstate(invalid="ignore"):
            landed = self._screen.land(points, along)
            return landed.u, landed.v, through & landed.met

    def toward(
        self, points: Triple, u: Floats, v: Floats, near: Triple | None = None
    ) -> tuple[list[Floats], Bools]:
        """Return unit vectors from points along which light lands at (u, v), and which of them do.

        near : unit vectors to begin with, where some are known.
        """
        if not self.surfaces:
            directions = normalised(self.receiver.toward(points, u, v))
            return directions, self.land(points, directions)[2]
        given = np.broadcast_arrays(*points, u, v, *(near or ()))
        flat = [a.ravel() for a in given]
        found = [
            self._aimed(*(a[k : k + BLOCK] for a in flat)) for k in range(0, max(1, flat[0].size), BLOCK)
        ]
        shape = given[0].shape
        directions = [np.concatenate(axis).reshape(shape) for axis in zip(*(part[0] for part in found))]
        return directions, np.concatenate([part[1] for part in found]).reshape(shape)

    def _aimed(self, *given: Floats) -> tuple[list[Floats], Bools]:
        """Return what `toward` returns, for (rays,) of each of what it takes."""
        into = self._into  # all else stands in the frame of the first surface
        points, (u, v) = into.points(given[:3]), given[3:5]
        near = into.directions(given[5:]) if given[5:] else ()
        middle = into.directions(np.array(normalised(self.surfaces[0].pose.shift)))
        aside = np.array(normalised(np.cross(middle, (0.0, 1.0, 0.01))))
        frame = aside, np.cross(middle, aside)

        def at(p: Floats, q: Floats) -> list[Floats]:
            length = np.sqrt(1 + p * p + q * q)
            return [(m + p * a + q * b) / length for m, a, b in zip(middle, *frame)]

        def missing(p: Floats, q: Floats) -> tuple[Floats, Bools]:
            landed = self._landed(points, at(p, q))
            return np.array([u - landed[0], v - landed[1]]), landed[2]

        p = q = np.zeros(u.shape)
        if near:
            ahead, *across = (sum(a * b for a, b in zip(near, axis)) for axis in (middle, *frame))
            p, q = (np.where(ahead > AHEAD, a / np.maximum(ahead, AHEAD), 0.0) for a in across)
        far = np.inf
        for _ in range(NEWTON_STEPS):
            left, through = missing(p, q)
            if far > CHORD:
                (up, vp), (uq, vq) = (
                    (left - missing(p + dp, q + dq)[0]) / DIFFERENCE
                    for dp, dq in ((DIFFERENCE, 0.0), (0.0, DIFFERENCE))
                )
            with np.errstate(divide="ignore", invalid="ignore"):
                step = np.array([left[0] * vq - left[1] * uq, left[1] * up - left[0] * vp])
                step /= up * vq - vp * uq
                reached = through & (abs(step) < SETTLED).all(axis=0)
            step = np.where(np.isfinite(step).all(axis=0), np.clip(step, -FARTHEST, FARTHEST), 0.0)
            p, q, far = p + step[0], q + step[1], float(abs(step).max())
            if far < SETTLED:
                break
        return list(into.inverse().directions(tuple(at(p, q)))), reached


def bent(mirror: bool, indices: Sequence[float], along: Triple, slopes: Triple) -> tuple[list[Floats], Bools]:
    """Return unit vectors behind a surface, and which rays go on.

    With r = n / n' and c = a . m for the unit normal m = (-z_x, -z_y, 1) / N: a - 2 c m, or
    r a + (sqrt(1 - r^2 (1 - c^2)) - r c) m.  Light that would be reflected totally leaves along the surface.

    indices : n before, n' behind.  along : unit vectors a, to +z of the surface.
    """
    zx, zy = slopes
    length = np.sqrt(1 + zx * zx + zy * zy)
    normal = [-zx / length, -zy / length, 1 / length]
    across = sum(a * m for a, m in zip(along, normal))
    if mirror:
        return [a - 2 * across * m for a, m in zip(along, normal)], across > 0
    ratio = indices[0] / indices[1]
    inside = ratio * across
    square = 1 - ratio * ratio + inside * inside
    outside = np.sqrt(np.maximum(square, 0.0))
    return [ratio * a + (outside - inside) * m for a, m in zip(along, normal)], (square > 0) & (across > 0)


def met(conic: Conic, point: Triple, along: Triple) -> list[Floats]:
    """Return where rays meet a conic: the root next to its vertex of

        c (x^2 + y^2 + (1 + K) z^2) = 2 z,

    NaN of rays that miss it.  point, along : in the frame of the conic.
    """
    c, stretch = 1 / conic.radius, 1 + conic.constant
    (x, y, z), (p, q, r) = point, along
    a = c * (p * p + q * q + stretch * r * r)
    b = r - c * (x * p + y * q + stretch * z * r)
    left = c * (x * x + y * y + stretch * z * z) - 2 * z
    with np.errstate(divide="ignore", invalid="ignore"):
        end = b + np.sign(b) * np.sqrt(b * b - a * left)
        roots, foot = (left / end, end / a), -(x * p + y * q + z * r)  # of the vertex on the ray
        t = np.where(abs(roots[1] - foot) < abs(roots[0] - foot), roots[1], roots[0])
        t = np.where(stretch * c * (z + t * r) <= 1, t, np.nan)
    return [x + t * p, y + t * q, z + t * r]


def slopes_at(conic: Conic, point: Triple) -> list[Floats]:
    """Return the slopes of a conic at points of it: c x / (1 - (1 + K) c z), and the same of y."""
    (x, y, z), c = point, 1 / conic.radius
    down = 1 - (1 + conic.constant) * c * z
    with np.errstate(divide="ignore", invalid="ignore"):
        return [c * x / down, c * y / down]


def normalised(vector: Triple) -> list[Floats]:
    """Return unit vectors."""
    length = np.sqrt(sum(np.square(v) for v in vector))
    return [v / length for v in vector]
