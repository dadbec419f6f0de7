"""How the surface that a transport map shapes sends light to the target: the rear, or a front alone.

Both know the slopes that send light to where it is wanted, and where light lands that slopes refract.  Points
are (x, y, z) in mm, directions unit vectors before the surface, landings x and y in mm, or degrees in the far
field.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isinf

import numpy as np
from numpy.typing import NDArray

from optics.transport.fixed_rear import FixedRear
from optics.transport.surface_slopes import refracted, refracting_slopes

Floats = NDArray[np.float64]
Slopes = tuple[tuple[Floats, Floats], NDArray[np.bool_], NDArray[np.bool_]]


@dataclass(frozen=True)
class ShapedRear:
    """A rear that is looked for.  index : of the glass.  target_z : mm, inf is the far field."""

    index: float
    target_z: float

    def slopes(self, points: Sequence[Floats], along: Sequence[Floats], wanted: Sequence[Floats]) -> Slopes:
        """Return the slopes (zx, zy) that send light where it is wanted, where they are gentle, and where
        light refracts so far.
        """
        x, y, z = points
        if isinf(self.target_z):
            dx, dy = (np.tan(np.radians(a)) for a in wanted)
            return refracting_slopes(self.index, along, (dx, dy, np.ones_like(dx)))
        return refracting_slopes(self.index, along, (wanted[0] - x, wanted[1] - y, self.target_z - z))

    def landing(
        self, points: Sequence[Floats], along: Sequence[Floats], slopes: Sequence[Floats]
    ) -> list[Floats]:
        """Return where light lands that slopes refract."""
        x, y, z = points
        dx, dy, dz = refracted(self.index, along, slopes)
        if isinf(self.target_z):
            return [np.degrees(np.arctan2(d, dz)) for d in (dx, dy)]
        down = (self.target_z - z) / dz
        return [x + dx * down, y + dy * down]


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
