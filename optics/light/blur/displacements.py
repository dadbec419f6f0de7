"""The light of a plate before a plane: the mean of that of one lens, displaced by the place of every lens.

    E(X) = sum over k of E_one(X - s_k) / n

It is a blur by n points.  Light that is even on every pixel is displaced exactly: a displacement by a part of
a pixel shares it among two.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from scipy.ndimage import convolve1d

from optics.light.blur.convolution import BlurOnto
from optics.scene.receivers import Screen
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats


@dataclass(frozen=True, eq=False)
class Displacements:
    """Where the lenses of a plate stand: in columns and rows, about its middle.

    x, y : mm, own places of the columns and of the rows.
    """

    x: Floats
    y: Floats

    @classmethod
    def of(cls, system: OpticalSystem) -> Displacements:
        """Return those that the light of a system has on its target: one lens, or the far field, has none."""
        return cls(*system.columns_and_rows)

    @property
    def widest(self) -> tuple[float, float]:
        """From the first column to the last, and from the first row to the last, mm."""
        return float(np.ptp(self.x)), float(np.ptp(self.y))

    def reach(self, screen: Screen) -> int:
        """Return how many pixels of a screen the light is displaced by at most, to either side."""
        return max(ceil(np.abs(at).max() / pitch) for at, pitch in zip((self.x, self.y), screen.pitch))

    def kernel(self, screen: Screen) -> Floats:
        """Return the light that pixels get of one, (odd, odd); its sum is 1."""
        along_x, along_y = (_shares(at / pitch) for at, pitch in zip((self.x, self.y), screen.pitch))
        return np.outer(along_y, along_x)

    def onto(self, screen: Screen) -> BlurOnto:
        """Return the blur as a screen sees it that has no margin."""
        along_x, along_y = (_shares(at / pitch) for at, pitch in zip((self.x, self.y), screen.pitch))

        def convolution(image: Floats) -> Floats:
            return np.asarray(
                convolve1d(convolve1d(image, along_x, 1, mode="constant"), along_y, 0, mode="constant")
            )

        reach = self.reach(screen)
        return BlurOnto(replace(screen.widened(reach), margin=0), 1, reach, convolution)


def _shares(places: Floats) -> Floats:
    """Return what pixels get of the light of one that is displaced to all places, in pixels, (odd,)."""
    reach = ceil(np.abs(places).max())
    pixels = np.arange(-reach, reach + 1)
    return np.maximum(1 - np.abs(pixels[:, None] - places), 0.0).mean(axis=1)
