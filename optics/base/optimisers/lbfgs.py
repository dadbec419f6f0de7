"""Quasi-Newton steps of limited memory, L-BFGS, along which scipy's line search goes.

Beside evaluations a step of 250 000 variables takes 7 ms.  Scipy's L-BFGS-B, which is made for bounds, takes
32: a sixth of a step of a design.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import line_search

from optics.base.optimisers.iterations import Callback, Function
from optics.base.runtime import UserError
from thbcad.checks import Floats

DECREASE, CURVATURE = 1e-3, 0.9  # of the Wolfe conditions
GROWTH, GROWN = 4.0, 10  # of a step that is too short, and how often at most
MOST = 2, 10  # evaluations for each step that is allowed, and besides; the last search is brought to its end
ROUNDING = float(np.finfo(float).eps)


@dataclass(frozen=True)
class LBFGS:
    """x <- x - a H g, where H is built from the last steps and changes of the gradient.

    The first step is one of length 1.  It ends where no step lowers the value.

    memory : pairs that are kept.
    least_decrease : of the value in a step that is worth another one, relative to the value at the start.

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

    def run(self, function: Function, start: Floats, iterations: int, callback: Callback) -> int:
        """Return the number of steps, see `Optimiser`."""
        x, pairs = start.copy(), _Pairs(self.memory, start.size)
        value, gradient = function(x)
        enough, evaluations = self.least_decrease * abs(value), 1
        for k in range(iterations):
            if evaluations > MOST[0] * iterations + MOST[1]:
                return k
            line = _Line(function, x, value, gradient, pairs.direction(gradient))
            if not line.lower and len(pairs):  # pairs of what has changed since
                evaluations += len(line.seen)
                pairs.clear()
                line = _Line(function, x, value, gradient, pairs.direction(gradient))
            if not line.lower:
                return k
            evaluations += len(line.seen)
            pairs.add(line.step, line.gradient - gradient)
            x, decrease = x + line.step, value - line.value
            value, gradient = line.value, line.gradient
            try:
                callback(x)
            except StopIteration:
                return k + 1
            if decrease <= enough:
                return k + 1
        return iterations


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
        if not step @ change > ROUNDING * float(np.linalg.norm(step) * np.linalg.norm(change)):
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
        inner = solve_triangular(upper, s)
        outer = solve_triangular(upper, upper.diagonal() * inner + c * (among @ inner - y), trans="T")
        weights = np.empty((2, len(self._rows)))
        weights[:, self._rows] = outer, -c * inner
        return -c * gradient - weights[0] @ self._steps[used] - weights[1] @ self._changes[used]


class _Line:
    """A search along a direction for a length where the Wolfe conditions hold.

    It begins with 1, or GROWTH times that, and so on, where the value still falls steeply there: scipy's
    search would double it.

    lower : it found a lower value: there, else the lowest that was seen.  step, value, gradient : there.
    seen : value and gradient by length.
    """

    def __init__(
        self, function: Function, x: Floats, value: float, gradient: Floats, direction: Floats
    ) -> None:
        self._function, self._x, self._direction = function, x, direction
        self.seen: dict[float, tuple[float, Floats]] = {}
        self.lower, slope, first = False, float(gradient @ direction), 1.0
        if not slope < 0:
            return
        for _ in range(GROWN):
            low = self._value(first) <= value + DECREASE * first * slope
            if not (low and self._slope(first) < CURVATURE * slope):
                break
            first *= GROWTH
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "The line search algorithm")  # did not converge
            share = line_search(
                lambda a: self._value(float(a[0])),
                lambda a: np.array([self._slope(float(a[0]))]),
                np.zeros(1),
                np.array([first]),
                np.array([slope]),
                value,
                c1=DECREASE,
                c2=CURVATURE,
            )[0]
        length = min(self.seen, key=self._value) if share is None else share * first
        self.step, (self.value, self.gradient) = length * direction, self._at(length)
        self.lower = self.value < value

    def _value(self, length: float) -> float:
        return self._at(length)[0]

    def _slope(self, length: float) -> float:
        return float(self._at(length)[1] @ self._direction)

    def _at(self, length: float) -> tuple[float, Floats]:
        """Return value and gradient, which are known together."""
        if length not in self.seen:
            self.seen[length] = self._function(self._x + length * self._direction)
        return self.seen[length]
