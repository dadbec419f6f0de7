"""What pixels leave of a ripple of light, and how wide they are seen on the lens."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def pixel_mtf(frequency: Sequence[Floats] | Floats, pitch: tuple[float, float]) -> Floats:
    """Return what the mean over a pixel leaves of a wave on the target, sinc(fx px) sinc(fy py).

    frequency : (fx, fy), cycles per mm or degree.  pitch : (px, py) of the pixels, in the same unit.
    """
    fx, fy = frequency
    return np.asarray(np.sinc(fx * pitch[0]) * np.sinc(fy * pitch[1]))


def on_target(waves: Sequence[float], landing: Floats, surface: Floats) -> Floats:
    """Return the local frequency on the target of a wave on the surface, (2, ...).

    f = DT^-T U^T k, with the maps T to the target and U to the surface: the wave's phase is the same.

    waves : (kx, ky) on the surface, cycles per mm.  landing : DT, surface : U, (2, 2, ...).
    """
    by_s, by_t = (surface[0, i] * waves[0] + surface[1, i] * waves[1] for i in (0, 1))
    (a, b), (c, d) = landing
    with np.errstate(divide="ignore", invalid="ignore"):  # folds
        return np.stack([d * by_s - c * by_t, a * by_t - b * by_s]) / (a * d - b * c)
