"""How much of the light crosses where a surface was measured.

The greatest disc round a place that no point lies in holds

    points in it, at the density of the others > ln n + CONFIDENCE,

in a gap alone: of n points at random, a disc as empty as that is there by chance in exp(-CONFIDENCE) of all
files, and of points on a grid in none.
"""

from __future__ import annotations

from math import log, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from optics.tolerancing.machining import LandingResponse
from thbcad.outlines import Outline

Floats = NDArray[np.float64]

RAYS = 257  # in each direction, by which the lit surface is known
NEAREST, MEDIAN = 8, 7.67  # the neighbour by which density is told, and the median of points up to it
CONFIDENCE = 6.0
FINE = 64  # points each way, by which the area of a strip is known
STRIP = 1.5  # distances of points: a narrower strip beside them is as near to them as they to each other


def measured_light(points: Floats, lit: LandingResponse, outline: Outline) -> float:
    """Return the fraction of the light for the target that crosses a surface where it was measured.

    points : x and y, (2, n) mm.  lit : rays that cross the surface.  outline : of it.
    """
    single = np.unique(points.T, axis=0)
    if len(single) <= NEAREST:
        return 0.0
    tree = cKDTree(single)
    apart = tree.query(single, k=NEAREST + 1)[0][:, -1]
    density = MEDIAN / (pi * float(np.median(apart)) ** 2)
    most = log(len(single)) + CONFIDENCE
    known, half_width = np.ones(len(lit.x), bool), outline.half_width
    for axis, at in enumerate(
        (lit.x, lit.y)
    ):  # strips at the rim, however narrow, that lie beside all points
        for sign, end in ((1, single[:, axis].max()), (-1, -single[:, axis].min())):
            strip = half_width[axis] - end
            if strip > STRIP / sqrt(density) and _beyond(outline, axis, end) * density > most:
                known &= sign * at <= end + STRIP / sqrt(density)
    nearest = tree.query(np.stack([lit.x, lit.y], axis=1))[0]
    sides = [
        np.minimum(at + nearest, h) - np.maximum(at - nearest, -h)
        for at, h in zip((lit.x, lit.y), half_width)
    ]
    expected = density * pi / 4 * sides[0] * sides[1]  # points in the part of a disc that lies on the surface
    known &= expected <= most
    return float(lit.flux[known].sum() / (lit.flux.sum() or 1.0))


def _beyond(outline: Outline, axis: int, end: float) -> float:
    """Return the area of an outline beyond a line across x (0) or y (1), mm^2."""
    high = np.array(outline.half_width)
    low = -high
    low[axis] = end
    area = 2 * outline.half_width[1 - axis] * (outline.half_width[axis] - end)
    return area * float(outline.shares((low[:1], low[1:]), (high[:1], high[1:]), FINE)[0])
