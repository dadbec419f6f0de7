"""Intensity in the planes C0-C180 and C90-C270, and the width of a beam in them.

Directions are those of type C photometry: gamma is the angle to +z, the half-plane C0 holds +x, C90 holds -y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thbcad.checks import Floats

BEAM = 0.5  # of the greatest intensity in a plane: where the IES ends the beam angle
FIELD = 0.1  # and where it ends the field angle


@dataclass(frozen=True, eq=False)
class PlaneCurve:
    """Intensity in a plane through the axis.

    gamma : (n,) degrees, ascending; positive in the first half-plane of the name, negative in the other.
    intensity : (n,).
    """

    gamma: Floats
    intensity: Floats

    def width(self, share: float) -> float | None:
        """Return the angle between the outermost directions of a share of the greatest intensity, degrees.

        Intensity is linear between its samples.  None where it is still greater at the first or the last one,
        and where there is no light.
        """
        level = share * float(self.intensity.max())
        if level <= 0:
            return None
        bright = np.flatnonzero(self.intensity >= level)
        first, last = int(bright[0]), int(bright[-1])
        if first == 0 or last == len(self.gamma) - 1:
            return None
        return self._crossing(last + 1, last, level) - self._crossing(first - 1, first, level)

    def least_width(self, share: float) -> float | None:
        """Return the angle between the outermost samples of a share of the greatest intensity, degrees.

        The width is at least this, also where light goes on beyond the samples.  None without light.
        """
        level = share * float(self.intensity.max())
        if level <= 0:
            return None
        bright = np.flatnonzero(self.intensity >= level)
        return float(self.gamma[bright[-1]] - self.gamma[bright[0]])

    def _crossing(self, outer: int, inner: int, level: float) -> float:
        """Return gamma where the intensity reaches a level between two neighbours."""
        step = (level - self.intensity[outer]) / (self.intensity[inner] - self.intensity[outer])
        return float(self.gamma[outer] + step * (self.gamma[inner] - self.gamma[outer]))


def plane_curves(intensity: Floats, u: Floats, v: Floats) -> dict[str, PlaneCurve]:
    """Return the curves of the planes "C0-C180" and "C90-C270".

    intensity : (rows, columns) at the angles u = atan(d_x / d_z) of the columns, ascending, and
    v = atan(d_y / d_z) of the rows, falling, degrees; both are symmetric.  Where no row or column lies on the
    axis, the two beside it are averaged.
    """
    return {"C0-C180": PlaneCurve(u, _middle(intensity)), "C90-C270": PlaneCurve(-v, _middle(intensity.T))}


def _middle(rows: Floats) -> Floats:
    """Return the middle row of an odd number, the mean of the two middle ones of an even number."""
    n = len(rows)
    mean: Floats = (rows[(n - 1) // 2] + rows[n // 2]) / 2
    return mean
