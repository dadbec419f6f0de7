"""A rear of given shape between a front that is looked for and the target: where to aim inside the glass.

A ray leaves the front at (x, y, z) along (p, q, 1).  It meets the rear z = t + c(x, y), is refracted there,
and lands at L(p, q).  `FixedRear.aimed` solves L(p, q) = wanted by Newton's method with differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optics.light.refraction.surface_slopes import refracted
from optics.scene.receivers import Receiver
from thbcad.checks import Floats
from thbcad.sags import Conic

NEWTON_STEPS = 6  # from a straight line: steps that double the digits; targets within reach need four
DIFFERENCE = 1e-6  # of p and q: the square root of the rounding of L, with some room
STEEPEST = 0.98  # of the least |(p, q)| that a plane rear reflects totally: the aim goes no farther
EXACT = 1e-12  # of the throw: no step is taken for less
REACHED = 1e-6  # of the throw: a landing as near as that is the one that was wanted


@dataclass(frozen=True)
class FixedRear:
    """The rear that light leaves by.

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
        tilt = [self.conic(x, y, derivative) for derivative in ((1, 0), (0, 1))]
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
