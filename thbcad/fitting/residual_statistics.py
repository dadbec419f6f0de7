"""What residuals say of samples: which are outliers, and whether the others are noise.

Both compare a residual r_k with those of its neighbours.  An outlier differs from them; detail that the fit
lacks does not, since it moves the residuals of neighbours together.

Source: A. Beaton, J. Tukey, The fitting of power series, Technometrics 16 (1974); P. Huber, E. Ronchetti,
Robust Statistics, sections 4.8 and 7.8; P. Moran, Notes on continuous stochastic phenomena, Biometrika 37
(1950).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import chdtri

from thbcad.checks import Floats, Integers

AROUND = 12  # neighbours that an outlier differs from: on a grid those within two steps
BESIDE = 4  # neighbours that missing detail moves together: on a grid those one step away
CUT = 4.685 / 0.6745  # medians of |r|: 4.685 normal standard deviations, an efficiency of 95 %
CHANCE = 3.0  # standard deviations: one of 700 fits to noise seems to lack detail


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
    result: Integers = np.take_along_axis(near, itself_last, axis=1)[:, : min(count, len(among) - 1)]
    return result


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
