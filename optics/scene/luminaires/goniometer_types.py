"""Photometry of types A and B as photometry of type C, whose axis is that of the beam.

A beam leaves along +z, the luminaire's length points up (+x), and its width to the right (+y), as seen from
behind the luminaire.  V > 0 is up, H > 0 is right.  The poles of type A lie at the ends of the length, those
of type B at the ends of the width:

    A   d = (sin V, cos V sin H, cos V cos H)        B   d = (cos H sin V, sin H, cos H cos V)

Between the angles of a file the intensity is bilinear in V and H, beyond them it is zero.  It is taken at the
nodes of a grid of C and gamma, twice as fine as the file where memory allows, and scaled so that the flux is
kept.

Sources: ANSI/IESNA LM-63-02, Standard file format for the electronic transfer of photometric data, 2002; IES
LM-75-01, Goniophotometer types and photometric coordinates, 2001.
"""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np

from optics.base.runtime import UserError
from optics.scene.luminaires.intensity_record import (
    FULL_TURN,
    SAME,
    directions_at,
    hat_integrals,
    interval_halves,
    require_ascending,
)
from thbcad.checks import Floats

TYPE_C, TYPE_B, TYPE_A = 1, 2, 3  # as LM-63 numbers them
QUARTER = 90.0  # degrees: the greatest V and H
GREATEST_STEP = (
    2.5  # degrees of gamma, also where half the least step of a file is larger; of C it is doubled
)
MOST_NODES = 2_000_000  # about, of the grid of C and gamma: 0.3 GB while it is made
PEAK_CHANGE = 0.02  # of the file's peak, by which a grid that is coarser than half the file's step may differ


def as_type_c(kind: int, v: Floats, h: Floats, candela: Floats) -> tuple[Floats, Floats, Floats]:
    """Return planes C from 0 to 360, angles gamma, and candelas (planes, gammas) of other photometry.

    kind : TYPE_A or TYPE_B.  v : (m,), h : (n,), degrees, ascending within -90 to 90; from 0 on the light is
    its own mirror image.  One h alone stands for light that is symmetric around the beam.  candela : (n, m).

    Raises UserError : other angles.
    """
    v, candela = _mirrored("vertical", v, candela)
    if len(h) == 1:
        return _round(v, candela[0])
    h, rows = _mirrored("horizontal", h, candela.T)
    values = rows.T if kind == TYPE_A else rows  # turns around the pole first, then latitudes
    turn, latitude = (h, v) if kind == TYPE_A else (v, h)
    half = float(min(np.diff(v).min(), np.diff(h).min(), 2 * GREATEST_STEP)) / 2
    farthest = np.cos(np.radians(np.abs(turn).max())) * np.cos(np.radians(np.abs(latitude).max()))
    reach = float(np.degrees(np.arccos(farthest)))  # the greatest gamma of a direction in the file
    step = max(half, sqrt(FULL_TURN / 2 * reach / MOST_NODES))
    gammas = np.linspace(0.0, QUARTER, ceil(QUARTER / step) + 1)
    gammas = np.append(gammas[:-1][gammas[:-1] < reach + 2 * step], QUARTER)
    planes = np.linspace(0.0, FULL_TURN, 4 * ceil(QUARTER / (2 * step)) + 1)
    x, y, z = directions_at(*(axis.ravel() for axis in np.meshgrid(planes, gammas, indexing="ij")))
    pole, across = (x, y) if kind == TYPE_A else (y, x)
    turns = np.degrees(np.arctan2(across, np.maximum(z, 0.0)))
    latitudes = np.degrees(np.arcsin(np.clip(pole, -1.0, 1.0)))
    found = _bilinear(turn, latitude, values, turns, latitudes).reshape(len(planes), len(gammas))
    found[-1] = found[0]
    held = values * np.outer(interval_halves(np.radians(turn)), hat_integrals(np.radians(latitude + QUARTER)))
    kept = found * np.outer(interval_halves(np.radians(planes)), hat_integrals(np.radians(gammas)))
    if not held.sum() > 0:
        raise UserError("it has no light within 90 degrees of the beam")
    candela = found * (held.sum() / kept.sum()) if kept.any() else found
    if step > half and abs(candela.max() / values.max() - 1) > PEAK_CHANGE:
        raise UserError(
            f"its angles are as close as {2 * half:.2g} degrees over a cone of {reach:.3g} degrees around "
            f"the beam, which takes more than {MOST_NODES:,} nodes of type C: at {step:.2g} degrees its peak "
            f"of {values.max():.4g} would be {candela.max():.4g}; leave out dark angles"
        )
    return planes, gammas, candela


def _mirrored(name: str, angles: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Return angles on both sides of 0 and values (others, angles), mirrored where the angles begin at 0."""
    if len(angles) == 1:
        return angles, rows
    require_ascending(f"{name} angles", angles)
    if angles[0] < -QUARTER or angles[-1] > QUARTER:
        raise UserError(
            f"{name} angles of types A and B lie between -90 and 90 degrees, got {angles[0]:g} to "
            f"{angles[-1]:g}"
        )
    if angles[0] != 0:
        return angles, rows
    return np.append(-angles[:0:-1], angles), np.hstack([rows[:, :0:-1], rows])


def _round(v: Floats, values: Floats) -> tuple[Floats, Floats, Floats]:
    """Return light that is symmetric around the beam from its values along V, which are even."""
    right, left = v >= 0, v <= 0
    even = right.sum() == left.sum() and np.abs(v[right] + v[left][::-1]).max() <= SAME * QUARTER
    if not even or np.abs(values[right] - values[left][::-1]).max() > SAME * np.abs(values).max():
        raise UserError(
            "its one horizontal angle means light that is symmetric around the beam, and its vertical angles "
            "or intensities are not; give the horizontal angles"
        )
    return np.array([0.0, FULL_TURN]), v[right], np.tile(values[right], (2, 1))


def _bilinear(turn: Floats, latitude: Floats, values: Floats, turns: Floats, latitudes: Floats) -> Floats:
    """Return values (turn, latitude) at points, (n,); zero beyond the grid."""
    i = np.clip(np.searchsorted(turn, turns, side="right") - 1, 0, len(turn) - 2)
    j = np.clip(np.searchsorted(latitude, latitudes, side="right") - 1, 0, len(latitude) - 2)
    s = (turns - turn[i]) / (turn[i + 1] - turn[i])
    t = (latitudes - latitude[j]) / (latitude[j + 1] - latitude[j])
    inside = (np.abs(s - 0.5) <= 0.5 + SAME) & (np.abs(t - 0.5) <= 0.5 + SAME)
    low = (1 - t) * values[i, j] + t * values[i, j + 1]
    high = (1 - t) * values[i + 1, j] + t * values[i + 1, j + 1]
    return np.where(inside, (1 - s) * low + s * high, 0.0)
