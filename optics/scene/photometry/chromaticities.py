"""Where a colour lies in the CIE 1976 diagram of uniform chromaticity."""

from __future__ import annotations

import numpy as np

from thbcad.checks import Floats


def chromaticity(xyz: Floats) -> Floats:
    """Return u' = 4 X / (X + 15 Y + 3 Z) and v' = 9 Y / (X + 15 Y + 3 Z), (2, ...); NaN of black.

    xyz : (3, ...), on any scale.
    """
    x, y, z = xyz
    total = x + 15 * y + 3 * z
    whole = np.where(total > 0, total, np.nan)
    return np.stack([4 * x / whole, 9 * y / whole])


def chromaticity_distance(xyz: Floats, white: Floats) -> Floats:
    """Return the distance of colours from a white in (u', v'), (...).  xyz : (3, ...).  white : (3,)."""
    u, v = chromaticity(xyz)
    u0, v0 = chromaticity(white)
    return np.hypot(u - u0, v - v0)
