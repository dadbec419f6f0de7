"""Outliers among samples, alone and in clumps, and the weights of the others.

A sample is suspected where Tukey's biweight of its residual is 0.  The samples beside it are then compared
with their nearest neighbours that are not, until no more are suspected: a clump is taken off from its border.

Suspects are outliers if at most 24 of them hang together, and if they lie beyond what the twelve nearest
good samples show by themselves, whatever the surface: with their least-squares plane a + b . (x - x_k)

    |z_k - a| > 2 max_i |z_i - a - b . (x_i - x_k)|.

All other suspects are detail that the surface lacks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from thbcad.checks import Floats, Integers
from thbcad.fitting.residual_statistics import AROUND, BESIDE, nearest, tukey_weights

TOGETHER = 24  # clumps of five among 3 % outliers at random meet up to 17 at a time; more show a shape
FEWEST = 5  # good samples: one more than those whose plane leaves them something
BEYOND = 2.0  # times the others' distance: 1.4 at the corner of a step; of noise 4 or 5 standard deviations


def biweights(residuals: Floats, values: Floats, points: Floats, near: Integers, least: float) -> Floats:
    """Return the weights of samples, (n,) from 0 to 1: Tukey's biweights of residuals, 0 only for outliers.

    residuals, values : (n, d).  points : (n, 2).  near : (n, 12), the nearest samples of each.
    least : residuals below it are rounding errors.
    """
    near, suspected = near.copy(), np.zeros(len(points), dtype=bool)
    while True:
        weights = tukey_weights(residuals, near, least)
        more = (weights == 0) & ~suspected
        suspected |= more
        good, beside = np.flatnonzero(~suspected), np.flatnonzero(more[near].any(axis=1))
        if not len(beside) or len(good) <= near.shape[1]:
            break
        near[beside] = nearest(points, beside, good, near.shape[1])
    chosen = np.flatnonzero(suspected)
    weights[chosen] = 1.0
    if len(chosen) and len(good) >= FEWEST:
        around = nearest(points, chosen, good, AROUND)
        weights[chosen[_few_together(chosen, points) & _beyond(values, points, chosen, around)]] = 0.0
    return weights


def _few_together(chosen: Integers, points: Floats) -> NDArray[np.bool_]:
    """Return which of the chosen points hang together with few others, by their four nearest, (chosen,)."""
    number = np.full(len(points), -1)
    number[chosen] = np.arange(len(chosen))
    near = number[nearest(points, chosen, np.arange(len(points)), BESIDE)]
    row, column = np.nonzero(near >= 0)
    links = csr_array((np.ones(len(row)), (row, near[row, column])), shape=(len(chosen), len(chosen)))
    _, clump = connected_components(links, directed=False)
    result: NDArray[np.bool_] = np.bincount(clump)[clump] <= TOGETHER
    return result


def _beyond(values: Floats, points: Floats, chosen: Integers, around: Integers) -> NDArray[np.bool_]:
    """Return which of the chosen samples lie much farther from the plane through those around them than any
    of these, (chosen,)."""
    apart = points[around] - points[chosen][:, None]
    apart /= np.abs(apart).max(axis=(1, 2), keepdims=True)
    columns = np.concatenate([np.ones((*around.shape, 1)), apart], axis=2)
    heights = values[around] - values[chosen][:, None]
    planes = np.linalg.pinv(columns) @ heights
    left = np.linalg.norm(heights - columns @ planes, axis=2).max(axis=1)
    result: NDArray[np.bool_] = np.linalg.norm(planes[:, 0], axis=1) > BEYOND * left
    return result
