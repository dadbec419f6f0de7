"""What the zones of a target add to the loss: places that miss what the design aims at.

    sum_k max(0, 1 - I_k / a_k)^2 + max(0, I_k / b_k - 1)^2

I_k is the light at every place of every row, a and b the limits within its margin.  Alone it would make light
bump at these places.  What keeps light smooth between them is the misfit to the target beside it, the
smoothest light that keeps the rows.  (A limit on the change of log10 I per 0.5 degrees does not: it charges
the border of the light most, which is steep on every lens.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.scene.receivers import Screen, ZoneRow
from optics.scene.system import LightTarget
from thbcad.checks import Floats


@dataclass(frozen=True, eq=False)
class ZoneLoss:
    """The loss on a screen.  rows : of its target, for intensities or irradiance on its surface."""

    screen: Screen
    rows: tuple[ZoneRow, ...]

    @classmethod
    def of(cls, target: LightTarget, screen: Screen) -> ZoneLoss | None:
        """Return the loss of a target, None where it has no zones."""
        rows = tuple(target.zone_rows(screen))
        return cls(screen, rows) if rows else None

    def __call__(self, padded: Floats) -> tuple[float, Floats]:
        """Return the loss and its derivative by the irradiance.  padded : with the screen's dark margin."""
        shown = self.screen.projection()
        light = self.screen.crop(padded) / shown
        loss, slope = 0.0, np.zeros(light.size)
        for row in self.rows:
            values, (least, greatest) = row.readings @ light.ravel(), row.aims(light)
            below = np.maximum(0.0, 1 - values / least) if least else 0 * values
            if row.brightest:
                below *= np.arange(len(values)) == np.argmax(values)
            above = np.maximum(0.0, values / greatest - 1)
            loss += float(below @ below + above @ above)
            slope += row.readings.T @ (2 * above / greatest - (2 * below / least if least else 0.0))
        return loss, self.screen.pad(slope.reshape(light.shape) / shown)
