"""Colours as sRGB, seen by an eye that has adapted to the source.

Colours go from the source's white to that of sRGB, D65, by the Bradford transform (ICC.1, annex E).  A
colour that sRGB cannot show is mixed with the grey of its own luminance until no channel is negative; what is
brighter than the picture's white is cut off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats

# IEC 61966-2-1: chromaticities (x, y) of red, green, blue and white
PRIMARIES = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]])
WHITE = np.array([0.3127, 0.3290])
BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def srgb(xyz: Floats, white: ArrayLike) -> Floats:
    """Return sRGB values from 0 to 1, encoded, (3, ...).

    xyz : (3, ...) colours.  white : (3,) the source's, on the same scale; it becomes (1, 1, 1).
    """
    colours, white = np.asarray(xyz, dtype=np.float64), np.asarray(white, dtype=np.float64)
    x, y = np.vstack([PRIMARIES, WHITE]).T
    rays = np.stack([x / y, np.ones_like(x), (1 - x - y) / y])
    from_rgb = rays[:, :3] * np.linalg.solve(rays[:, :3], rays[:, 3])  # to XYZ, whose white has Y = 1
    screen_white = from_rgb.sum(axis=1)
    gains = (BRADFORD @ screen_white) / (BRADFORD @ white)
    adapted = np.linalg.solve(BRADFORD, gains[:, None] * BRADFORD)
    linear = np.tensordot(np.linalg.solve(from_rgb, adapted), colours, axes=1)
    grey = np.maximum(np.tensordot(from_rgb[1], linear, axes=1), 0.0)  # of the same luminance
    least = linear.min(axis=0)
    kept = np.where(least < 0, grey / np.where(least < 0, grey - least, 1.0), 1.0)
    return encoded_srgb(np.clip(grey + kept * (linear - grey), 0.0, 1.0))


def encoded_srgb(linear: Floats) -> Floats:
    """Return sRGB's encoding of linear light."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
