"""Optimisers of scipy: gradient descent with an exact line search, and L-BFGS-B."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from optics.base.optimisers.iterations import Callback, Function, require_step
from optics.base.runtime import UserError
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


@dataclass(frozen=True)
class LBFGS:
    """Quasi-Newton steps: the Hessian is built from the last pairs of steps and changes of the gradient.

    memory : pairs that are kept.
    least_decrease : of the value in a step that is worth another one, relative; None is scipy's own.

    Source: R. H. Byrd, P. Lu, J. Nocedal, C. Zhu, SIAM J. Sci. Comput. 16 (1995) 1190-1208.

    >>> from scipy.optimize import rosen, rosen_der
    >>> minimise(lambda c: (rosen(c), rosen_der(c)), np.zeros(2), LBFGS(memory=5)).loss < 1e-9
    True
    """

    memory: int = 10
    least_decrease: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.memory, int) or isinstance(self.memory, bool) or self.memory < 1:
            raise UserError(f"memory must be a whole number from 1 on, got {self.memory!r}")

    def run(self, function: Function, start: Floats, iterations: int, callback: Callback) -> int:
        """Return the number of steps, see `Optimiser`."""
        if not iterations:  # scipy would take a step
            function(start)
            return 0
        options = {"maxiter": iterations, "maxcor": self.memory, "maxfun": 2 * iterations + 10, "gtol": 0.0}
        if self.least_decrease is not None:
            options["ftol"] = self.least_decrease
        result = minimize(function, start, jac=True, method="L-BFGS-B", options=options, callback=callback)
        return int(result.nit)
