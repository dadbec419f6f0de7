"""Quasi-Newton steps of limited memory: L-BFGS.

Beside evaluations a step of 250 000 variables takes 7 ms.  Scipy's L-BFGS-B, which is made for bounds, takes
32: a sixth of a step of a design.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from optics.base.optimisers.iterations import Callback, Function, require_fraction
from optics.base.runtime import UserError
from thbcad.checks import Floats

DECREASE, CURVATURE = 1e-3, 0.9  # of the Wolfe conditions
TRIES = 20  # evaluations of a line search, at most
GROWTH, SHORTEST, LONGEST = 4.0, 0.01, 0.9  # of a length that is too short, and of one between two others
MOST = 2, 10  # evaluations for each step that is allowed, and besides; a search is brought to its end
ROUNDING, TINY = np.finfo(float).eps, np.finfo(float).tiny


@dataclass(frozen=True)
class LBFGS:
    """x <- x - a H g, where H is built from the last steps and changes of the gradient.

    The first step that is tried has the length 1.  It ends where no step lowers the value, where one lowers
    it too little, or after many evaluations.

    memory : pairs that are kept.
    least_decrease : of the value in a step that is worth another one, relative to the value, or to the lesser
        of 1 and the value at the start where that is more.

    Source: J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed. (2006), 7.2.

    >>> from scipy.optimize import rosen, rosen_der
    >>> minimise(lambda c: (rosen(c), rosen_der(c)), np.zeros(2), LBFGS(memory=5)).loss < 1e-9
    True
    """

    memory: int = 10
    least_decrease: float = 2.2e-9

    def __post_init__(self) -> None:
        if not isinstance(self.memory, int) or isinstance(self.memory, bool) or self.memory < 1:
            raise UserError(f"memory must be a whole number from 1 on, got {self.memory!r}")
        require_fraction("least_decrease", self.least_decrease)

    def run(self, function: Function, start: Floats, iterations: int, callback: Callback) -> int:
        """Return the number of steps, see `Optimiser`."""
        here, pairs = _Point.of(function, start.copy()), _Pairs(self.memory, start.size)
        least, evaluations, most = min(1.0, abs(here.value)), 1, MOST[0] * iterations + MOST[1]
        for k in range(iterations):
            if evaluations > most:
                return k
            found, tried = _searched(function, here, pairs.direction(here.gradient))
            evaluations += tried
            if found is None and len(pairs) and evaluations <= most:  # old pairs may mislead
                pairs.clear()
                found, tried = _searched(function, here, pairs.direction(here.gradient))
                evaluations += tried
            if found is None:
                return k
            pairs.add(found.x - here.x, found.gradient - here.gradient)
            decrease, here = here.value - found.value, found
            try:
                callback(here.x)
            except StopIteration:
                return k + 1
            if decrease <= self.least_decrease * max(least, abs(here.value)):
                return k + 1
        return iterations


@dataclass(frozen=True, eq=False)
class _Point:
    """Where a function was evaluated."""

    x: Floats
    value: float
    gradient: Floats

    @classmethod
    def of(cls, function: Function, x: Floats) -> _Point:
        value, gradient = function(x)
        return cls(x, float(value), np.array(gradient))  # which the function may use again


class _Pairs:
    """The last steps s and changes y of the gradient, and the inverse Hessian that they tell:

        H = c I + S W S^T - c (S R^-T Y^T + Y R^-1 S^T),    W = R^-T (D + c Y^T Y) R^-1

    with the upper triangle R of S^T Y, its diagonal D, and c = s^T y / y^T y of the newest pair.

    Source: R. H. Byrd, J. Nocedal, R. B. Schnabel, Representations of quasi-Newton matrices and their use in
    limited memory methods, Math. Program. 63 (1994) 129-156, (3.1).
    """

    def __init__(self, most: int, size: int) -> None:
        self._steps, self._changes = np.empty((2, most, size))
        self._steps_changes, self._changes_changes = np.empty((2, most, most))  # S^T Y, Y^T Y
        self._rows: list[int] = []  # from the oldest pair to the newest

    def __len__(self) -> int:
        return len(self._rows)

    def clear(self) -> None:
        """Forget all pairs."""
        self._rows.clear()

    def add(self, step: Floats, change: Floats) -> None:
        """Add a pair; one along which the gradient does not grow tells nothing."""
        size = float(np.linalg.norm(step) * np.linalg.norm(change))
        if not (step @ change > ROUNDING * size and change @ change > TINY):
            return
        count = len(self._rows)
        row = self._rows.pop(0) if count == len(self._steps) else count
        self._rows.append(row)
        self._steps[row], self._changes[row] = step, change
        used = slice(len(self._rows))
        self._steps_changes[used, row] = self._steps[used] @ change
        self._changes_changes[used, row] = self._changes_changes[row, used] = self._changes[used] @ change

    def direction(self, gradient: Floats) -> Floats:
        """Return -H g; without a pair a step of length 1 against g."""
        if not self._rows:
            return -gradient / (float(np.linalg.norm(gradient)) or 1.0)
        by_age, used = np.ix_(self._rows, self._rows), slice(len(self._rows))
        upper, among = np.triu(self._steps_changes[by_age]), self._changes_changes[by_age]
        c = upper[-1, -1] / among[-1, -1]
        s, y = ((rows[used] @ gradient)[self._rows] for rows in (self._steps, self._changes))
        inner = solve_triangular(upper, s, check_finite=False)
        known = upper.diagonal() * inner + c * (among @ inner - y)
        outer = solve_triangular(upper, known, trans="T", check_finite=False)
        weights = np.empty((2, len(self._rows)))
        weights[:, self._rows] = outer, -c * inner
        return -c * gradient - weights[0] @ self._steps[used] - weights[1] @ self._changes[used]


def _searched(function: Function, here: _Point, direction: Floats) -> tuple[_Point | None, int]:
    """Return a point along a direction where the strong Wolfe conditions hold, else the lowest that was seen,
    None where none is lower than here; and how many were evaluated.

    Lengths that are too short and too long enclose it.

    Source: J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed. (2006), 3.5, for the conditions.
    """
    slope = float(here.gradient @ direction)
    if not slope < 0:
        return None, 0
    lowest, length, short, long = here, 1.0, (0.0, here.value, slope), (np.inf, np.inf)
    for tried in range(1, TRIES + 1):
        point = _Point.of(function, here.x + length * direction)
        lowest = point if point.value < lowest.value else lowest
        falls = float(point.gradient @ direction)
        low = point.value <= here.value + DECREASE * length * slope
        if not low or falls > -CURVATURE * slope:
            long = length, point.value
        elif falls < CURVATURE * slope:
            short = length, point.value, falls
        else:
            return point, tried
        length = _between(*short, *long)
    return (None if lowest is here else lowest), TRIES


def _between(short: float, value: float, slope: float, long: float, beyond: float) -> float:
    """Return the length to try next: the minimum of the parabola with the value and slope where it is too
    short, and the value where it is too long."""
    if np.isinf(long):
        return GROWTH * short
    reach = long - short
    excess = beyond - value - slope * reach
    share = -slope * reach / (2 * excess) if 0 < excess < np.inf else SHORTEST
    return short + reach * min(max(share, SHORTEST), LONGEST)
