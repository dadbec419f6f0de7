"""How the surface that a transport map shapes sends light to the target: the rear, or a front alone.

Both know the slopes that send light to where it is wanted, and where light lands that slopes refract.  Points
are (x, y, z) in mm, directions unit vectors before the surface, landings x and y in mm, or degrees in the far
field.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optics.light.refraction.fixed_rear import FixedRear
from optics.light.refraction.surface_slopes import refracted, refracting_slopes
from optics.scene.receivers import Receiver
from thbcad.checks import Floats

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
