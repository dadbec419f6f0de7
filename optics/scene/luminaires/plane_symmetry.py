"""Planes C that files leave out because the light is symmetric."""

from __future__ import annotations

import numpy as np

from optics.base.runtime import UserError
from optics.scene.luminaires.intensity_record import FULL_TURN, SAME, require_ascending
from thbcad.checks import Floats

MEASURED = 0.05  # of the peak: what two measurements of one plane may differ by; a real file has 0.021


def full_turn(planes: Floats, candela: Floats) -> tuple[Floats, Floats]:
    """Return planes from 0 to 360 degrees with their candelas, (k,) and (k, m).

    First and last plane say what the light is symmetric about: one alone the axis, 0 to 90 the planes 0 and
    90, 0 to 180 the plane 0, 90 to 270 the plane 90.  Without symmetry 360 may be left out.

    Raises UserError : planes that do not ascend, have other ends, or contradict each other.
    """
    if len(planes) == 1:
        return np.array([0.0, FULL_TURN]), np.repeat(candela, 2, axis=0)
    require_ascending("planes C", planes)
    first, last = planes[0], planes[-1]
    if (first, last) == (0, 90):
        return _mirrored(*_mirrored(planes, candela))
    if (first, last) == (0, 180):
        return _mirrored(planes, candela)
    if (first, last) == (90, 270):
        return _from_zero(*_mirrored(planes, candela))
    if first == 0 and 180 < last <= FULL_TURN <= last + np.diff(planes).max() * (1 + SAME):
        return closed(planes, candela)
    raise UserError(
        f"its planes C run from {first:g} to {last:g} degrees; they must run from 0 to 0, 90, 180 or 360, "
        "or from 90 to 270"
    )


def closed(planes: Floats, candela: Floats) -> tuple[Floats, Floats]:
    """Return planes whose last one is 360 degrees, with equal candelas there and at 0: the mean of both.

    Raises UserError : they differ by more than two measurements of one plane do.
    """
    if planes[-1] < FULL_TURN:
        return np.append(planes, FULL_TURN), np.vstack([candela, candela[:1]])
    if np.abs(candela[-1] - candela[0]).max() > MEASURED * candela.max():
        raise UserError("its planes C = 0 and C = 360 differ, and are one; mend the file")
    mean = (candela[:1] + candela[-1:]) / 2
    return planes, np.vstack([mean, candela[1:-1], mean])


def _mirrored(planes: Floats, candela: Floats) -> tuple[Floats, Floats]:
    """Return planes with their mirror images about the last one behind it."""
    return np.append(planes, 2 * planes[-1] - planes[-2::-1]), np.vstack([candela, candela[-2::-1]])


def _from_zero(planes: Floats, candela: Floats) -> tuple[Floats, Floats]:
    """Return planes from 90 to 450 degrees as planes from 0 to 360, between which nothing changes."""
    cut = int(np.searchsorted(planes, FULL_TURN))
    if planes[cut] != FULL_TURN:
        s = (FULL_TURN - planes[cut - 1]) / (planes[cut] - planes[cut - 1])
        between = (1 - s) * candela[cut - 1] + s * candela[cut]
        planes, candela = np.insert(planes, cut, FULL_TURN), np.insert(candela, cut, between, axis=0)
    return (
        np.append(planes[cut:] - FULL_TURN, planes[1 : cut + 1]),
        np.vstack([candela[cut:], candela[1 : cut + 1]]),
    )
