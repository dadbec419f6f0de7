"""Snell's law at a surface z(x, y) that light leaves: the slopes for a direction, and the reverse.

The normal (-z_x, -z_y, 1) lies along n a - d, for light of direction a in index n that leaves along d.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thbcad.checks import Floats

STEEPEST = 0.15  # least z of n a - d: steeper slopes are not asked for


def refracting_slopes(
    index: float, along: Sequence[Floats], leaving: Sequence[Floats]
) -> tuple[tuple[Floats, Floats], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the slopes (z_x, z_y) that refract light, where they are gentle (STEEPEST), and where light can
    be turned so far.

    A surface turns light by less than arccos(1 / n): n a . d > 1 for unit vectors.

    along : unit vectors a in the index.  leaving : directions d of any length.
    """
    length = np.sqrt(sum(np.square(d) for d in leaving))
    out = [d / length for d in leaving]
    normal = [index * a - d for a, d in zip(along, out)]
    refracts = np.greater(index * sum(a * d for a, d in zip(along, out)), 1)
    gentle = normal[2] > STEEPEST
    across = np.where(gentle, normal[2], 1.0)
    return (-normal[0] / across, -normal[1] / across), gentle, refracts


def refracted(index: float, along: Sequence[Floats], slopes: Sequence[Floats]) -> list[Floats]:
    """Return the unit vectors d of light that leaves a surface with slopes (z_x, z_y).

    Light that would be reflected totally leaves along the surface.
    """
    zx, zy = slopes
    length = np.sqrt(1 + zx * zx + zy * zy)
    normal = [-zx / length, -zy / length, 1 / length]
    inside = index * sum(a * m for a, m in zip(along, normal))
    outside = np.sqrt(np.maximum(1 - index * index + inside * inside, 0.0))
    return [index * a + (outside - inside) * m for a, m in zip(along, normal)]
