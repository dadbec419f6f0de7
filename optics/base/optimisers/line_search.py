"""Gradient descent with an exact line search, by scipy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from optics.base.optimisers.iterations import Callback, Function, require_step
from thbcad.checks import Floats

PRECISION = 1e-2  # of the step: a finer search costs evaluations and gains nothing for the next step
TRIALS = 20  # at most, behind those that bracket the minimum


@dataclass(frozen=True)
class LineSearch:
    """p <- p - a g, a = argmin L(p - a g); every trial is an evaluation.

    step : of the first trial, in the variable with the greatest entry of g.  Later searches start from the
        step before.

    >>> minimise(lambda c: (c @ c, 2 * c), np.array([3.0, 4.0]), LineSearch(), iterations=1).loss < 1e-9
    True
    """

    step: float = 0.01

    def __post_init__(self) -> None:
        require_step(self.step)

    def run(self, function: Function, start: Floats, iterations: int, callback: Callback) -> int:
        """Return the number of steps, see `Optimiser`; it ends where no step lowers the value."""
        x, trial = start.copy(), None
        value, gradient = function(x)
        for k in range(iterations):
            greatest = float(np.abs(gradient).max())
            if greatest == 0:
                return k
            trial = trial or self.step / greatest
            along = _Line(function, x, gradient)
            minimize_scalar(along, (0.0, trial), tol=PRECISION, options={"maxiter": TRIALS})
            if not along.least < value:
                return k
            trial, value, gradient = along.best, along.least, along.gradient
            x = x - trial * along.direction
            try:
                callback(x)
            except StopIteration:
                return k + 1
        return iterations


class _Line:
    """The function along a line, and the best point of it that was seen."""

    def __init__(self, function: Function, x: Floats, direction: Floats) -> None:
        self._function, self._x, self.direction = function, x, direction
        self.least, self.best, self.gradient = np.inf, 0.0, direction

    def __call__(self, length: float) -> float:
        value, gradient = self._function(self._x - length * self.direction)
        if value < self.least:
            self.least, self.best, self.gradient = value, float(length), gradient
        return value
