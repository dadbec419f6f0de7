"""The exact non-negative approximation for two point sources.

The image is g[y] ~ w0 F[y] + w1 F[y - s].  Pixels y, y + s, y + 2 s ... form a chain; chains do not meet, and
on each the normal matrix is tridiagonal: w0^2 + w1^2 on the diagonal, w0 w1 beside it.  All chains stand
behind one another in one tridiagonal system.

Source: J. Judice and F. Pires, Comput. Oper. Res. 21 (1994), block principal pivoting; thesis 7.31 and 7.42.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solveh_banded

from optics.designing.etendue import Approximation, Kernel, certified, require_target
from thbcad.checks import EPS, Floats

PATIENCE = 3  # steps of all infeasible pixels at once without fewer of them, before only the last one changes


@dataclass(frozen=True, eq=False)
class Chains:
    """Pixels in the order of their chains.

    pixels : (n,) int, flat indices
    chain : (n,) int, the number of the pixel's chain, 0, 0, ..., 1, 1, ...
    lit : (n,) bool, False for the last pixel of a chain, above which light would miss the image
    """

    pixels: NDArray[np.int64]
    chain: NDArray[np.int64]
    lit: NDArray[np.bool_]


def approximate_two_deltas(
    shift: tuple[int, int], weights: tuple[float, float], target: ArrayLike
) -> Approximation:
    """Return light F >= 0 that minimises ||E * F - G||^2 up to rounding.

    E = w0 delta(x) + w1 delta(x - shift)

    shift : (rows, columns) between the sources
    weights : (w0, w1), non-negative; divided by their sum
    target : (n, m), G >= 0, dark where it is nearer to the border than the shift, so that light beyond the
        border is of no use.  Pad it by zeros.

    The result is that of ``approximate(Kernel.points([(0, 0), shift], weights), target)``.

    Raises ValueError : a target that is negative, not finite, dark or lit near its border; weights that are
        negative or zero.
    """
    kernel = Kernel.points([(0, 0), shift], weights)
    goal = require_target(kernel, target)
    (n, m), (i, j) = goal.shape, np.abs(np.asarray(shift))
    if np.count_nonzero(goal[i : n - i, j : m - j]) < np.count_nonzero(goal):
        raise ValueError(
            f"the target must be dark within {i} rows and {j} columns of its border (the shift); "
            "pad it by zeros"
        )
    light = np.zeros(kernel.light_shape(goal.shape))
    if not any(shift) or min(weights) == 0:
        at = (0, 0) if weights[0] > 0 else shift
        light[i - at[0] : i - at[0] + n, j - at[1] : j - at[1] + m] = goal
        return certified(kernel, light, goal, 0)
    chains = chains_of(shift, goal)
    part = np.asarray(weights, dtype=np.float64) / sum(weights)
    solved, steps = _pivot(chains, goal.ravel()[chains.pixels], part)
    rows, columns = np.unravel_index(chains.pixels, goal.shape)
    light[rows + i, columns + j] = solved
    return certified(kernel, light, goal, steps)


def chains_of(shift: tuple[int, int], target: Floats) -> Chains:
    """Return the chains of a shift other than (0, 0) that meet the target's light."""
    at = np.indices(target.shape)
    left = [
        np.where(s > 0, (side - 1 - x) // max(abs(s), 1), x // max(abs(s), 1))
        for x, s, side in zip(at, shift, target.shape)
        if s
    ]
    before = [(x - s < 0) | (x - s >= side) for x, s, side in zip(at, shift, target.shape)]
    first = np.flatnonzero(before[0] | before[1])
    length = np.minimum.reduce(left).ravel()[first] + 1
    stride = shift[0] * target.shape[1] + shift[1]
    chain = np.repeat(np.arange(len(first)), length)
    position = np.arange(len(chain)) - np.repeat(np.cumsum(length) - length, length)
    pixels = first[chain] + stride * position
    used = (np.bincount(chain, target.ravel()[pixels]) > 0)[chain]
    last = (position == length[chain] - 1)[used]
    chain = np.unique(chain[used], return_inverse=True)[1]
    return Chains(pixels[used], chain, ~last)


def _pivot(chains: Chains, target: Floats, weights: Floats) -> tuple[Floats, int]:
    """Return the f >= 0 of min ||w0 f[k] + w1 f[k - 1] - g[k]|| and the number of steps.

    f is 0 where the chains are not lit.

    Infeasible pixels (f < 0 where free, gradient < 0 where f = 0) all change sides.  A chain on which that
    does not help changes its last infeasible pixel only, which ends after finitely many steps.
    """
    w0, w1 = weights
    right = w0 * target + w1 * np.append(target[1:], 0)
    couple = w0 * w1 * (chains.lit[:-1] & chains.lit[1:])
    # the condition number of a chain is below its length squared
    slack = EPS * np.bincount(chains.chain).max() ** 2 * target.max()
    free = chains.lit & (right > 0)
    least = np.full(chains.chain[-1] + 1, len(target))
    patience = np.full(len(least), PATIENCE)
    step = 0
    while True:
        step += 1
        f = _solve(free, couple, w0**2 + w1**2, right)
        slope = (w0**2 + w1**2) * f - right
        slope[:-1] += couple * f[1:]
        slope[1:] += couple * f[:-1]
        wrong = np.where(free, f, slope) < -slack
        wrong &= chains.lit
        if not wrong.any():
            return np.maximum(f, 0), step
        count = np.bincount(chains.chain[wrong], minlength=len(least))
        # a chain that has had no fewer infeasible pixels for PATIENCE steps changes its last one only
        fewer = count < least
        least = np.minimum(least, count)
        patience = np.where(fewer, PATIENCE, patience - 1)
        stuck = (patience < 0)[chains.chain]
        at = np.flatnonzero(wrong & stuck)
        final = at[np.append(np.diff(chains.chain[at]) > 0, True)] if len(at) else at
        change = wrong & ~stuck
        change[final] = True
        free = free ^ change


def _solve(free: NDArray[np.bool_], couple: Floats, diagonal: float, right: Floats) -> Floats:
    """Return the solution of the tridiagonal system on the free pixels, 0 on the others."""
    banded = np.zeros((2, len(right)))
    banded[0, 1:] = couple * (free[:-1] & free[1:])
    banded[1] = diagonal
    return solveh_banded(banded, np.where(free, right, 0), check_finite=False)
