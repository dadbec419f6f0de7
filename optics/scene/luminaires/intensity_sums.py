"""Rays as an intensity: their flux on a grid of angles, so that the flux of all is kept.

A ray gives its flux to the four nodes around its direction, bilinearly in C and gamma.  A node's intensity is
its flux over the integral of the function that is 1 there and 0 at the others.  So the interpolated intensity
has the flux of the rays, and it is the light smoothed over one step of the grid.
"""

from __future__ import annotations

import numpy as np

from optics.scene.luminaires.intensity_record import (
    FARTHEST_GAMMA,
    FULL_TURN,
    Luminaire,
    Opening,
    angles_of,
    hat_integrals,
)
from thbcad.checks import Floats


class IntensityGrid:
    """A regular grid of angles over the full sphere.

    turns, tilts : steps of C and of gamma.
    """

    def __init__(self, turns: int, tilts: int) -> None:
        self.turns, self.tilts = turns, tilts
        self._gammas = np.linspace(0, FARTHEST_GAMMA, tilts + 1)

    @property
    def steps(self) -> tuple[float, float]:
        """Of C and gamma, degrees."""
        return FULL_TURN / self.turns, FARTHEST_GAMMA / self.tilts

    def flux(self, direction: Floats, flux: Floats) -> Floats:
        """Return the flux of rays at the nodes, (turns, tilts + 1).  direction : (3, n).  flux : (n,)."""
        c, gamma = angles_of(direction)
        (s, i), (t, j) = (np.modf(a / step) for a, step in zip((c, gamma), self.steps))
        i, j = i.astype(np.int64), j.astype(np.int64)
        j, t = np.minimum(j, self.tilts - 1), np.where(j < self.tilts, t, 1.0)
        total = np.zeros(self.turns * (self.tilts + 1))
        for turn, by_turn in ((i, 1 - s), (i + 1, s)):
            for tilt, by_tilt in ((j, 1 - t), (j + 1, t)):
                at = turn % self.turns * (self.tilts + 1) + tilt
                total += np.bincount(at, by_turn * by_tilt * flux, len(total))
        nodes = total.reshape(self.turns, self.tilts + 1)
        nodes[:, [0, -1]] = nodes[:, [0, -1]].mean(axis=0)  # one direction for all C
        return nodes

    def intensity(self, flux: Floats) -> Floats:
        """Return the intensity of flux at the nodes, (turns + 1, tilts + 1); the last plane is the first."""
        solid = 2 * np.pi / self.turns * hat_integrals(np.radians(self._gammas))
        return np.vstack([flux, flux[:1]]) / solid

    def luminaire(self, flux: Floats, opening: Opening) -> Luminaire:
        """Return the luminaire of flux at the nodes."""
        return Luminaire(
            np.linspace(0, FULL_TURN, self.turns + 1), self._gammas, self.intensity(flux), opening
        )
