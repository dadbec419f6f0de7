"""How even light is where it is asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Uniformity:
    """Light on the pixels of an area.

    mean : in the unit of the light.  min_over_mean : E_min / E_mean.  min_over_max : E_min / E_max.
    """

    mean: float
    min_over_mean: float
    min_over_max: float


def uniformity(light: NDArray[np.float64], lit: NDArray[np.bool_]) -> Uniformity | None:
    """Return how even light is on some pixels; None where there are none, or all are dark.

    Negative light, which noise and rounding leave, counts as none in the least.

    light : (rows, columns).  lit : the mask of the pixels, (rows, columns).
    """
    values = light[lit]
    if not values.size or values.max() <= 0 or values.mean() <= 0:
        return None
    least, mean = max(0.0, float(values.min())), float(values.mean())
    return Uniformity(mean, least / mean, least / float(values.max()))
