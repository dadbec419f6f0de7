"""How the surface that a transport map shapes sends light to the target: the rear, or a front alone.

Both know the slopes that send light to where it is wanted, and where light lands that slopes refract.  Points
are (x, y, z) in mm, directions unit vectors before the surface, landings x and y in mm, or degrees in the far
field.

By Snell's law the normal (-z_x, -z_y, 1) of a surface z(x, y) lies along n a - d, for light of direction a in
index n that leaves along d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optics.scene.receivers import Receiver
from thbcad.checks import Floats
from thbcad.sags import Conic

LEAST_Z = 0.15  # of n a - d: steeper slopes are not asked for
NEWTON_STEPS = 6  # from a straight line: steps that double the digits; targets within reach need four
DIFFERENCE = 1e-6  # of p and q: the square root of the rounding of L, with some room
STEEPEST = 0.98  # of the least |(p, q)| that a plane rear reflects totally: the aim goes no farther
EXACT = 1e-12  # of the throw: no step is taken for less
REACHED = 1e-6  # of the throw: a landing as near as that is the one that was wanted


def refracting_slopes(
    index: float, along: Sequence[Floats], leaving: Sequence[Floats]
) -> tuple[tuple[Floats, Floats], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the slopes (z_x, z_y) that refract light, where they are gentle (LEAST_Z), and where light can
    be turned so far.

    A surface turns light by less than arccos(1 / n): n a . d > 1 for unit vectors.

    along : unit vectors a in the index.  leaving : directions d of any length.
    """
    length = np.sqrt(sum(np.square(d) for d in leaving))
    out = [d / length for d in leaving]
    normal = [index * a - d for a, d in zip(along, out)]
    refracts = np.greater(index * sum(a * d for a, d in zip(along, out)), 1)
    gentle = normal[2] > LEAST_Z
    across = np.where(gentle, normal[2], 1.0)
    return (-normal[0] / across, -normal[1] / across), gentle, refracts


def refracted(index: float, along: Sequence[Floats], slopes: Sequence[Floats]) -> list[Floats]:
    """Return the unit vectors d of light that leaves a surface with slopes (z_x, z_y).

    Light that would be reflected totally leaves along the surface.
    """
    zx, zy = slopes
    length = np.sqrt(1 + zx * zx + zy * zy)
    normal = [-zx / length, -zy / length, 1 / length]
    inside = index * sum(a * m for a, m in zip(along, normal))
    outside = np.sqrt(np.maximum(1 - index * index + inside * inside, 0.0))
    return [index * a + (outside - inside) * m for a, m in zip(along, normal)]


@dataclass(frozen=True)
class FixedRear:
    """The rear that light leaves by: where to aim inside the glass.

    A ray leaves the front at (x, y, z) along (p, q, 1).  It meets the rear z = t + c(x, y), is refracted,
    and lands at L(p, q).  `aimed` solves L(p, q) = wanted by Newton's method with differences.

    index : of the glass.  thickness : mm, its vertex on the z axis.
    receiver : of the light behind it.
    """

    index: float
    conic: Conic
    thickness: float
    receiver: Receiver

    def landing(self, points: Sequence[Floats], slopes: Sequence[Floats]) -> list[Floats]:
        """Return where rays from points (x, y, z) along (p, q, 1) land, mm or degrees.

        slopes : p and q.
        """
        (x, y, z), (p, q) = points, slopes
        drop = self.thickness - z
        x, y = x + p * drop, y + q * drop
        height = self._meeting((x, y), (p, q))
        x, y, drop = x + p * height, y + q * height, drop + height
        length = np.sqrt(1 + p * p + q * q)
        along = [p / length, q / length, 1 / length]
        tilt = [self.conic.formula(x, y, derivative) for derivative in ((1, 0), (0, 1))]
        dx, dy, dz = refracted(self.index, along, tilt)
        landed = self.receiver.land((x, y, z + drop), (dx, dy, np.maximum(dz, DIFFERENCE)))
        return [landed.u, landed.v]

    def _meeting(self, points: Sequence[Floats], slopes: Sequence[Floats]) -> Floats:
        """Return the height h over the vertex at which rays (x + p h, y + q h, h) meet the conic.

        It is the root of c (r^2 + (1 + K) h^2) = 2 h next to the vertex; NaN of rays that miss the conic.
        """
        (x, y), (p, q) = points, slopes
        c, stretch = 1 / self.conic.radius, 1 + self.conic.constant
        a, b = c * (p * p + q * q + stretch), 1 - c * (p * x + q * y)
        with np.errstate(divide="ignore", invalid="ignore"):
            height = c * (x * x + y * y) / (b + np.sqrt(b * b - a * c * (x * x + y * y)))
            return np.where(stretch * c * height <= 1, height, np.nan)

    def aimed(
        self, points: Sequence[Floats], wanted: Sequence[Floats]
    ) -> tuple[list[Floats], NDArray[np.bool_]]:
        """Return unit vectors inside the glass that land where it is wanted, and which of them do.

        wanted : x and y, mm or degrees.
        """
        apart = self.receiver.pose.shift - (0.0, 0.0, self.thickness)
        throw = np.degrees(1.0) if self.receiver.far_field else float(np.linalg.norm(apart))
        most = STEEPEST / np.sqrt(self.index**2 - 1)
        dx, dy, dz = self.receiver.toward(points, *wanted)
        p, q = dx / (self.index * dz), dy / (self.index * dz)
        for _ in range(NEWTON_STEPS):
            p, q = _within(most, p, q)
            missing = [w - a for w, a in zip(wanted, self.landing(points, (p, q)))]
            if max(np.abs(m).max() for m in missing) < EXACT * throw:
                break
            p, q = (a + d for a, d in zip((p, q), self._step(points, (p, q), missing)))
        p, q = _within(most, p, q)
        left = np.hypot(*(w - a for w, a in zip(wanted, self.landing(points, (p, q)))))
        length = np.sqrt(1 + p * p + q * q)
        return [p / length, q / length, 1 / length], left < REACHED * throw

    def _step(
        self, points: Sequence[Floats], slopes: Sequence[Floats], missing: Sequence[Floats]
    ) -> list[Floats]:
        """Return Newton's step in p and q; none where it cannot be told, behind the rim of a conic."""
        (p, q), (mx, my) = slopes, missing
        here = self.landing(points, slopes)
        xp, yp = ((a - b) / DIFFERENCE for a, b in zip(self.landing(points, (p + DIFFERENCE, q)), here))
        xq, yq = ((a - b) / DIFFERENCE for a, b in zip(self.landing(points, (p, q + DIFFERENCE)), here))
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = (np.array([mx * yq - my * xq, my * xp - mx * yp])) / (xp * yq - yp * xq)
        return [*np.where(np.isfinite(steps).all(axis=0), steps, 0.0)]


def _within(most: float, p: Floats, q: Floats) -> tuple[Floats, Floats]:
    """Return slopes that are shortened to a greatest length."""
    shrink = np.minimum(1.0, most / np.maximum(np.hypot(p, q), DIFFERENCE))
    return p * shrink, q * shrink


Slopes = tuple[tuple[Floats, Floats], NDArray[np.bool_], NDArray[np.bool_]]


@dataclass(frozen=True)
class ShapedRear:
    """A rear that is looked for.  index : of the glass.  receiver : of the light behind it."""

    index: float
    receiver: Receiver

    def slopes(self, points: Sequence[Floats], along: Sequence[Floats], wanted: Sequence[Floats]) -> Slopes:
        """Return the slopes (zx, zy) that send light where it is wanted, where they are gentle, and where
        light refracts so far.
        """
        return refracting_slopes(self.index, along, self.receiver.toward(points, *wanted))

    def landing(
        self, points: Sequence[Floats], along: Sequence[Floats], slopes: Sequence[Floats]
    ) -> list[Floats]:
        """Return where light lands that slopes refract."""
        landed = self.receiver.land(points, refracted(self.index, along, slopes))
        return [landed.u, landed.v]


@dataclass(frozen=True)
class ShapedFront:
    """A front that is looked for, before a rear that is given."""

    rear: FixedRear

    def slopes(self, points: Sequence[Floats], along: Sequence[Floats], wanted: Sequence[Floats]) -> Slopes:
        """See `ShapedRear.slopes`."""
        inside, reached = self.rear.aimed(points, wanted)
        # light takes the same way back: out of the glass at the front, to where it comes from
        slopes, gentle, refracts = refracting_slopes(self.rear.index, inside, along)
        return slopes, gentle & reached, refracts & reached

    def landing(
        self, points: Sequence[Floats], along: Sequence[Floats], slopes: Sequence[Floats]
    ) -> list[Floats]:
        """See `ShapedRear.landing`."""
        dx, dy, dz = refracted(1 / self.rear.index, along, slopes)
        return self.rear.landing(points, (dx / dz, dy / dz))
