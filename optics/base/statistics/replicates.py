"""Values and errors from independent replicates of a measurement.

Replicates are independent and unbiased, so that their spread holds every error that chance makes, also errors
that neighbouring pixels share.  One replicate alone has no spread: its errors are 0 here.

Source: B. Efron and C. Stein, The jackknife estimate of variance, Annals of Statistics 9 (1981).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import sqrt

import numpy as np

from thbcad.checks import Floats, Integers

DEGENERATE = 3  # replicates, above which the part of a square's variance that noise alone makes is known


def standard_error(draws: Floats) -> Floats:
    """Return the standard error of the mean of replicates, sqrt(var / R), without their first axis.

    draws : (R, ...).
    """
    count = len(draws)
    if count == 1:
        return np.zeros(draws.shape[1:])
    return np.asarray(draws.std(axis=0, ddof=1) / sqrt(count))


def jackknife_error(count: int, value_without: Callable[[int], float | Floats]) -> Floats:
    """Return the standard error of any function of a mean of replicates, in the shape of its values.

    With the values v_r of the function without replicate r it is sqrt((R - 1) / R sum (v_r - mean v)^2).

    count : R.  value_without : returns v_r of the number r.
    """
    values = np.array([value_without(r) for r in range(count)])
    return np.asarray(np.sqrt((count - 1) / count * np.square(values - values.mean(axis=0)).sum(axis=0)))


def crossed_choice(draws: Floats, choose: Callable[..., Integers]) -> Integers:
    """Return for every replicate the place that the mean of the other half of the replicates chooses, (R,).

    The minimum of a noisy mean is biased low, because it follows the noise.  At a place that other replicates
    chose, a replicate's value is unbiased for that place.  Where noise confuses places of nearly equal light,
    the mean of these values lies above the true minimum by less than its own error.

    draws : (R, n).  choose : np.argmin or np.argmax.
    """
    if len(draws) == 1:
        return np.asarray(choose(draws, axis=1))
    first, second = (choose(draws[k::2].sum(axis=0)) for k in (0, 1))
    return np.asarray([second, first] * len(draws))[: len(draws)]


def crossed_error(values: Floats, chosen: Integers) -> float:
    """Return the standard error of the mean of values at a `crossed_choice`.

    Where both halves choose the same place, it follows from the spread of all values.  Else it is the larger
    of the spread within the halves and half of the difference between them, which includes the choice.

    values, chosen : (R,).
    """
    halves = values[0::2], values[1::2]
    if len(halves[1]) < 2 or chosen[0] == chosen[1]:
        return float(standard_error(values))
    within = float(np.hypot(*(standard_error(half) for half in halves)))
    return max(within, abs(float(halves[0].mean() - halves[1].mean()))) / 2


def unbiased_square(draws: Floats) -> tuple[float, float]:
    """Return (||x||^2 of the vector x that all replicates measure, the variance of this estimate).

    The estimate is the mean of the products (x_r, x_s) over all replicates r != s, so that noise adds nothing
    to it; one replicate alone has ||x_1||^2.  The variance is the jackknife's, corrected for the part that
    noise alone makes, which the jackknife counts twice (the second term of Hoeffding's decomposition).

    draws : (R, n).
    """
    count = len(draws)
    products = draws @ draws.T
    if count == 1:
        return float(products[0, 0]), 0.0
    apart = ~np.eye(count, dtype=bool)
    value = float(products[apart].mean())
    rows = np.where(apart, products, 0.0).sum(axis=1)
    if count == 2:
        return value, float(np.square(np.diff(rows)).sum()) / 2
    away = rows - rows.mean()
    variance = 4 * float(away @ away) / (count * (count - 1) * (count - 2) ** 2)
    if count > DEGENERATE:
        left = products - value - np.add.outer(away, away) / (count - 2)
        noise = float(np.square(left[apart]).sum()) / (count * (count - 3))
        twice = 4 * noise / (count * (count - 2))
        alone = 2 * noise / (count * (count - 1))
        variance = max(variance - twice + alone, alone)
    return value, variance


def root_error(square: float, variance: float) -> float:
    """Return the standard deviation of sqrt(square): sd / (2 sqrt(square)), and sqrt(sd) where that is 0.

    square, variance : as of `unbiased_square`.
    """
    return sqrt(max(square, 0.0) + sqrt(variance)) - sqrt(max(square, 0.0))


def drift_signs(shape: tuple[int, ...]) -> list[Floats]:
    """Return four patterns of signs with which an error of known size may come, to be multiplied with it.

    All are alike, or they alternate from row to row, from column to column, or both.

    shape : (rows, columns).
    """
    rows, columns = np.ix_(*(np.where(np.arange(n) % 2, -1.0, 1.0) for n in shape))
    return [np.ones((1, 1)), rows, columns, rows * columns]


def drift_error(value: float | Floats, shifted: Sequence[float] | Floats) -> float:
    """Return the error of a value by an error of known size and unknown signs.

    shifted : four values, with the signs of `drift_signs`.  The first change counts whole, since errors of
        neighbours are mostly alike; the others as one of them.
    """
    changes = np.asarray(shifted) - value
    return float(np.sqrt(changes[0] ** 2 + np.mean(changes[1:] ** 2)))
