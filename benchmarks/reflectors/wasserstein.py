"""How far light must move: the distance of Wasserstein between sets of points, each of the same flux.

    W2^2 = min over permutations p of  mean_k |x_k - y_p(k)|^2

Source: D. F. Crouse, On implementing 2D rectangular assignment algorithms, IEEE Trans. Aerosp. Electron.
Syst. 52 (2016), as scipy has it.
"""

from __future__ import annotations

import numpy as np

from thbcad.checks import Floats


def distance(one: Floats, other: Floats) -> float:
    """Return W2 of two sets of as many points, (n, 2) each; it takes 8 n^2 bytes."""
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    cost = cdist(one, other, "sqeuclidean")
    return float(np.sqrt(cost[linear_sum_assignment(cost)].mean()))


def drawn_points(count: int, half: float, density: Floats, seed: int) -> Floats:
    """Return Sobol points spread like a density, (count, 2).  half, density : as above."""
    from scipy.stats import qmc

    s, t = qmc.Sobol(2, seed=seed).random(count).T
    borders = half * (2 * np.arange(len(density) + 1) / len(density) - 1)
    sums = np.cumsum(np.pad(density, ((0, 0), (1, 0))), axis=1)
    strips = np.cumsum(np.pad(sums[:, -1], (1, 0)))
    x = np.interp(s, strips / strips[-1], borders)
    strip = np.searchsorted(borders, x, side="right") - 1
    y = np.empty(count)
    for k in np.unique(strip):
        y[strip == k] = np.interp(t[strip == k], sums[k] / sums[k, -1], borders)
    return np.stack([x, y], axis=1)
