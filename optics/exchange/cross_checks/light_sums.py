"""Landing points on pixels, and how far two traces of the same rays are apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.light.tracing import LandingPoints
from optics.scene.receivers import Screen
from thbcad.checks import Floats

NO_LIGHT = 1e-12  # of a ray's mean flux: rays with less count nowhere, and programs may round it to none


@dataclass(frozen=True, eq=False)
class Distances:
    """Landing points of the same rays by two tracers; sums of two of them are those of all rays.

    squares : sum of squared distances of rays that land on the target by both.  greatest : distance.
    count : of these rays.  mismatched : flux of rays that arrive by one only, W.
    """

    squares: float = 0.0
    greatest: float = 0.0
    count: int = 0
    mismatched: float = 0.0

    def __add__(self, other: Distances) -> Distances:
        return Distances(
            self.squares + other.squares,
            max(self.greatest, other.greatest),
            self.count + other.count,
            self.mismatched + other.mismatched,
        )

    @property
    def rms(self) -> float:
        """Root mean square distance; infinite where no ray lands on the target by both."""
        return float(np.sqrt(self.squares / self.count)) if self.count else float("inf")


def distances(one: LandingPoints, other: LandingPoints, emitted: Floats, screen: Screen) -> Distances:
    """Return the Distances of the same rays.  emitted : flux of the rays, (n,) W."""
    least = NO_LIGHT * emitted.mean()
    lit, others_lit = one.flux > least, other.flux > least
    both = lit & others_lit
    both[both] = (np.abs(other.points[both]) <= screen.half_width).all(axis=1)
    apart = np.linalg.norm(one.points[both] - other.points[both], axis=1)
    return Distances(
        squares=float((apart**2).sum()),
        greatest=float(apart.max(initial=0.0)),
        count=len(apart),
        mismatched=float(emitted[lit != others_lit].sum()),
    )


def binned(landing: LandingPoints, screen: Screen) -> Floats:
    """Return flux and sum of squared flux of the rays on every pixel, (2, rows, columns), W and W^2."""
    return np.stack([screen.binned(landing.points, landing.flux**power) for power in (1, 2)])


def on_target(landing: LandingPoints, screen: Screen) -> int:
    """Return how many rays land on the target."""
    lit = landing.flux > 0
    return int((np.abs(landing.points[lit]) <= screen.half_width).all(axis=1).sum())
