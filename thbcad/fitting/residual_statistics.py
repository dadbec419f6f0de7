"""What residuals say of samples: which are outliers, alone and in clumps, and whether the others are noise.

The statistics compare a residual r_k with those of its neighbours.  An outlier differs from them; detail that
the fit lacks does not, since it moves the residuals of neighbours together.

Source: A. Beaton, J. Tukey, The fitting of power series, Technometrics 16 (1974); P. Huber, E. Ronchetti,
Robust Statistics, sections 4.8 and 7.8; P. Moran, Notes on continuous stochastic phenomena, Biometrika 37
(1950).

A sample is suspected where Tukey's biweight of its residual is 0.  The samples beside it are then compared
with their nearest neighbours that are not, until no more are suspected: a clump is taken off from its border.

Suspects are outliers if at most 24 of them hang together, and if they lie beyond what the twelve nearest
good samples show by themselves, whatever the surface: with their least-squares plane a + b . (x - x_k)

    |z_k - a| > 2 max_i |z_i - a - b . (x_i - x_k)|.

All other suspects are detail that the surface lacks.
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.special import chdtri

from thbcad.checks import Bools, Floats, Integers

AROUND = 12  # neighbours that an outlier differs from: on a grid those within two steps
BESIDE = 4  # neighbours that missing detail moves together: on a grid those one step away
CUT = 4.685 / 0.6745  # medians of |r|: 4.685 normal standard deviations, an efficiency of 95 %
CHANCE = 3.0  # standard deviations: one of 700 fits to noise seems to lack detail
TOGETHER = 24  # clumps of five among 3 % outliers at random meet up to 17 at a time; more show a shape
FEWEST = 5  # good samples: one more than those whose plane leaves them something
BEYOND = 2.0  # times the others' distance: 1.4 at the corner of a step; of noise 4 or 5 standard deviations


def places(u: Floats, v: Floats) -> Floats:
    """Return points, (n, 2), in units of the extent of all of them in u and in v."""
    return np.column_stack([x / (np.ptp(x) or 1.0) for x in (u, v)])


def nearest(points: Floats, chosen: Integers, among: Integers, count: int) -> Integers:
    """Return the nearest other points of each chosen one, (chosen, count) int, fewer columns if there are
    fewer points.

    points : (n, 2).  among : the indices of those that may be near.
    """
    _, near = cKDTree(points[among]).query(points[chosen], k=min(count + 1, len(among)))
    near = among[near.reshape(len(chosen), -1)]
    itself_last = np.argsort(near == chosen[:, None], axis=1, kind="stable")
    return np.take_along_axis(near, itself_last, axis=1)[:, : min(count, len(among) - 1)]


def neighbours(u: Floats, v: Floats, count: int) -> Integers:
    """Return the nearest other points of each point, (n, count) int, fewer columns if there are fewer points.

    Distances are relative to the extent of all points in u and in v.
    """
    every = np.arange(len(u))
    return nearest(places(u, v), every, every, count)


def tukey_weights(residuals: Floats, near: Integers, least: float) -> Floats:
    """Return Tukey's biweights of residuals (n, d), (n,) from 0 to 1: 0 for outliers.

        t_k = (1 - (x_k / C)^2)^2 for x_k < C, else 0,   x_k = |r_k - m_k| / max(S, S_k, least),

    where m_k is the median of the neighbours' residuals, S_k their median distance from m_k, S the median of
    all |r_k - m_k|, and C = 6.95 (4.685 standard deviations of one normal component).  Because of S_k a slope
    or a peak that the fit lacks is no outlier.
    """
    if not near.size:
        return np.ones(len(residuals))
    around = residuals[near]
    centre = np.median(around, axis=1)
    apart = np.linalg.norm(residuals - centre, axis=1)
    local = np.median(np.linalg.norm(around - centre[:, None], axis=2), axis=1)
    scale = np.maximum(np.maximum(np.median(apart), local), least)
    result: Floats = np.maximum(1 - (apart / (CUT * scale)) ** 2, 0) ** 2
    return result


def kept_share(d: int) -> float:
    """Return what the biweights leave of the squares of normal residuals of d components, E[t |x|^2] / d.

    With the median M of |x|^2 and c = 1 / (C^2 M) it is 1 - 2 (d + 2) c + (d + 2) (d + 4) c^2, from the
    moments of |x|^2: 0.76 for d = 1.
    """
    c = 1 / (CUT**2 * float(chdtri(d, 0.5)))
    return 1 - 2 * (d + 2) * c + (d + 2) * (d + 4) * c**2


def are_noise(residuals: Floats, near: Integers) -> bool:
    """Return whether residuals (n, d) of neighbours are independent, by Moran's I.

    I = sum_k r_k . (mean of r over the m neighbours of k) / sum_k |r_k|^2 is positive where detail is
    missing; of noise its variance is at most 2 / (n m d), and I below three standard deviations is noise.
    """
    squares = float(np.sum(residuals**2))
    together = float(np.sum(residuals * residuals[near].mean(axis=1)))
    return together <= CHANCE * float(np.sqrt(2 / (near.size * residuals.shape[1]))) * squares


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


def _few_together(chosen: Integers, points: Floats) -> Bools:
    """Return which of the chosen points hang together with few others, by their four nearest, (chosen,)."""
    number = np.full(len(points), -1)
    number[chosen] = np.arange(len(chosen))
    near = number[nearest(points, chosen, np.arange(len(points)), BESIDE)]
    row, column = np.nonzero(near >= 0)
    links = csr_array((np.ones(len(row)), (row, near[row, column])), shape=(len(chosen), len(chosen)))
    _, clump = connected_components(links, directed=False)
    result: Bools = np.bincount(clump)[clump] <= TOGETHER
    return result


def _beyond(values: Floats, points: Floats, chosen: Integers, around: Integers) -> Bools:
    """Return which of the chosen samples lie much farther from the plane through those around them than any
    of these, (chosen,)."""
    apart = points[around] - points[chosen][:, None]
    apart /= np.abs(apart).max(axis=(1, 2), keepdims=True)
    columns = np.concatenate([np.ones((*around.shape, 1)), apart], axis=2)
    heights = values[around] - values[chosen][:, None]
    planes = np.linalg.pinv(columns) @ heights
    left = np.linalg.norm(heights - columns @ planes, axis=2).max(axis=1)
    result: Bools = np.linalg.norm(planes[:, 0], axis=1) > BEYOND * left
    return result
