"""How far light must move: the distance of Wasserstein between rays and a density on a grid.

    W2^2 = max over g of  sum_k m_k min_j (|x_k - y_j|^2 - g_j) + mean_j g_j

for cells x_k of masses m_k, of sum 1, and rays at y_j, each of the same flux.  Any g bounds it from below.
The cells of a ray are those nearest to it by |x - y_j|^2 - g_j.  Newton's method raises g: the Hessian is the
Laplacian of the graph of rays that share borders, each weighted by its density over twice their distance.

Source: J. Kitagawa, Q. Merigot, B. Thibert, Convergence of a Newton algorithm for semi-discrete optimal
transport, J. Eur. Math. Soc. 21 (2019).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import spsolve
from scipy.spatial import KDTree

from thbcad.checks import Floats

STEPS = 40
LEAST_STEP = 1 / 64
CHANGE = 2e-4  # of the value: with less another step does not pay
ALONE = 1e-3  # of the mean diagonal: what holds rays without a border


def distance_to_density(rays: Floats, half: float, density: Floats) -> float:
    """Return a lower bound of W2, near to it where light errs over no more than the distance of rays.

    Steps end early where cells become empty: of a mirror of case 4 after 20 iterations the bound is 0.0049,
    where the distances of u and of v alone prove 0.0136.

    rays : (n, 2), each of the same flux.
    density : (m, m), of any scale, on the cells of the square |x|, |y| <= half, index order x, y.
    """
    masses, m = density / density.sum(), len(density)
    row = half * ((2 * np.arange(m) + 1) / m - 1)
    lit = masses > 0
    points = np.stack(np.meshgrid(row, row, indexing="ij"), axis=-1)[lit]

    def nearest(g: Floats) -> tuple[NDArray[np.int64], float]:
        """Return the ray of every lit cell, and the bound: power cells are those of lifted points."""
        tree = KDTree(np.c_[rays, np.sqrt(g.max() - g)])
        distance, which = tree.query(np.c_[points, np.zeros(len(points))])
        labels = np.full(masses.shape, -1)
        labels[lit] = which
        return labels, float(masses[lit] @ (distance**2 - g.max()) + g.mean())

    g = np.zeros(len(rays))
    labels, bound = nearest(g)
    for _ in range(STEPS):
        missing = 1 / len(rays) - np.bincount(labels[lit], masses[lit], len(rays))
        direction = spsolve(_hessian(rays, labels, masses, 2 * half / m), missing)
        step = 1.0
        while step >= LEAST_STEP:
            further = nearest(g + step * direction)
            if further[1] > bound:
                break
            step /= 2
        else:
            break
        g, gain, (labels, bound) = g + step * direction, further[1] - bound, further
        if gain < CHANGE * bound:
            break
    return float(np.sqrt(bound))


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


def _hessian(rays: Floats, labels: NDArray[np.int64], masses: Floats, pitch: float) -> coo_array:
    """Return the Laplacian of the rays whose cells share a border.  pitch : of the grid."""
    pairs, weights = [], []
    for axis in (0, 1):
        one, other = (np.moveaxis(labels, axis, 0)[k] for k in (slice(1, None), slice(-1)))
        mean = sum(np.moveaxis(masses, axis, 0)[k] for k in (slice(1, None), slice(-1))) / 2
        border = (one != other) & (one >= 0) & (other >= 0)
        a, b = one[border], other[border]
        apart = np.maximum(np.linalg.norm(rays[a] - rays[b], axis=1), pitch)
        pairs += [(a, b), (b, a)]
        weights += 2 * [mean[border] / (2 * apart * pitch)]
    i, j = (np.concatenate(k) for k in zip(*pairs))
    shared = coo_array((np.concatenate(weights), (i, j)), shape=(len(rays),) * 2).tocsc()
    diagonal = np.asarray(shared.sum(axis=1)).ravel()
    return diags_array(diagonal + ALONE * diagonal.mean(), format="csc") - shared
