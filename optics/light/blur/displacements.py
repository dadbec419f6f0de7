"""The light of a plate before a plane: the mean of that of one lens, displaced by the place of every lens.

    E(X) = sum over k of E_one(X - s_k) / n

It is a blur by n points.  Light that is even on every pixel is displaced exactly: a displacement by a part of
a pixel shares it among two.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array, diags_array

from optics.base.runtime import Backend, UserError
from optics.light.blur.convolution import MOST_AROUND, BlurOnto, blur_of
from optics.scene.paths import LightPath
from optics.scene.receivers import Screen
from optics.scene.system import System
from thbcad.checks import Floats

# times as many parts of a pixel as for a smooth spot: pictures keep their borders (a top hat by six lenses,
# 64 pixels wide, is designed 13.5 % off with 1 part, 7.3 with 4, 5.9 with 8)
FINER = 2
MOST_PARTS = 2048  # of all pixels in each direction: those of large pictures are small, and fill the memory


class Spread(Protocol):
    """What spreads the light of every point alike: a `Blur`, or the `Displacements` of a plate."""

    def reach(self, screen: Screen) -> int:
        """Return how many pixels of a screen it reaches."""

    def widened(self, screen: Screen) -> Screen:
        """Return a screen that is wider by the reach.

        Raises UserError : too many pixels.
        """

    def parts(self, screen: Screen, most: int) -> int:
        """Return into how many parts a pixel is cut in each direction, for it to see what lies within.

        most : of them, for smooth spots.
        """

    def onto(self, screen: Screen, times: int = 1, margin: int = 0) -> BlurOnto:
        """Return the spread as a screen without a margin sees it, see `Blur.onto`."""


@dataclass(frozen=True, eq=False)
class Displacements:
    """Where the lenses of a plate stand: in columns and rows, about its middle.

    x, y : mm, places of the columns and of the rows.
    """

    x: Floats
    y: Floats

    @classmethod
    def of(cls, system: System) -> Displacements:
        """Return those that the light of a system has on its target: one lens, or the far field, has none."""
        return cls(*system.columns_and_rows)

    @property
    def widest(self) -> tuple[float, float]:
        """From the first column to the last, and from the first row to the last, mm."""
        return float(np.ptp(self.x)), float(np.ptp(self.y))

    def reach(self, screen: Screen) -> int:
        """Return how many pixels of a screen the light is displaced by at most, to either side."""
        return max(ceil(np.abs(at).max()) for at in self._in_pixels(screen))

    def widened(self, screen: Screen) -> Screen:
        """Return a screen that is wider by the reach.

        Raises UserError : the lenses lie over more pixels than memory holds.
        """
        reach, most = self.reach(screen), max(screen.pixels)
        if most + 2 * reach > max(MOST_AROUND, 3 * most):
            raise UserError(
                f"the lenses of lens.array lie over {2 * reach} pixels, and the target has {most}: too many "
                "to compute; use fewer of either, or a wider target"
            )
        return screen.widened(reach)

    def parts(self, screen: Screen, most: int) -> int:
        """Return into how many parts a pixel is cut in each direction, see `Spread.parts`.

        Light that moves by f of a part is blurred by the variance f (1 - f) of that: the number with the
        least is taken, which is 1 where all move by whole pixels.
        """
        moved, most = (
            np.concatenate(self._in_pixels(screen)),
            min(FINER * most, MOST_PARTS // max(screen.pixels)),
        )

        def variance(parts: int) -> float:
            f = parts * moved % 1.0
            return round(float((f * (1 - f)).max()) / parts**2, 9)

        return min(range(1, max(1, most) + 1), key=variance)

    def kernel(self, screen: Screen) -> Floats:
        """Return the light that pixels get of one, (odd, odd); its sum is 1."""
        along_x, along_y = map(_shares, self._in_pixels(screen))
        return np.outer(along_y, along_x)

    def onto(self, screen: Screen, times: int = 1, margin: int = 0) -> BlurOnto:
        """Return the mean over the displacements as a screen without a margin sees it, see `Blur.onto`.

        Raises UserError : see `widened`.
        """
        wide = replace(self.widened(screen).finer(times), margin=times * margin)
        rows, columns = (_mean_along(moved, n) for moved, n in zip(self._in_pixels(wide)[::-1], wide.padded))
        extra = times * (self.reach(screen) + margin)
        return BlurOnto(
            wide, times, extra, lambda image: np.ascontiguousarray((columns @ (rows @ image).T).T)
        )

    def _in_pixels(self, screen: Screen) -> tuple[Floats, Floats]:
        return self.x / screen.pitch[0], self.y / screen.pitch[1]


def spreads_of(system: System, path: LightPath, backend: Backend) -> list[Spread]:
    """Return what spreads the light of a path through a lens, from the target back: what is asked for is what
    the first makes of what the next makes of sharp light."""
    of_plate: list[Spread] = [Displacements.of(system)] if system.displaced else []
    return [*of_plate, *([blur_of(system, path, backend)] if system.blurred else [])]


def _shares(moved: Floats) -> Floats:
    """Return what pixels get of the light of one that is moved to all places, in pixels, (odd,)."""
    reach = ceil(np.abs(moved).max())
    pixels = np.arange(-reach, reach + 1)
    return np.asarray(np.maximum(1 - np.abs(pixels[:, None] - moved), 0.0).mean(axis=1))


def _mean_along(moved: Floats, count: int) -> csr_array:
    """Return the mean over movements of `count` pixels in a line, beyond which it is dark; symmetric."""
    shares = _shares(moved)
    offsets = np.flatnonzero(shares)
    reach = len(shares) // 2
    return csr_array(
        diags_array(
            [np.full(count, shares[k]) for k in offsets], offsets=offsets - reach, shape=(count, count)
        )
    )
