"""Minimising a loss over coefficients: for scripts that bring their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from optics.base.optimisers import LBFGS, Adam, Optimiser
from optics.base.runtime import NumericalError, UserError, one_blas_thread
from optics.interface.api.coefficient_vectors import Coefficients, packed, real_numbers
from thbcad.checks import Floats, floats

Loss = Callable[[Coefficients], tuple[float, Coefficients]]
METHODS: dict[str, Callable[[], Optimiser]] = {"lbfgs": LBFGS, "adam": Adam}


@dataclass(frozen=True, eq=False)
class Minimum:
    """The best coefficients that were seen.

    losses : of every evaluation, in their order.  interrupted : by Ctrl-C.

    >>> found = minimise(lambda c: (c @ c, 2 * c), np.array([3.0, 4.0]))
    >>> found.losses[0], found.loss < 1e-12, found.interrupted
    (25.0, True, False)
    """

    coefficients: Coefficients
    loss: float
    losses: tuple[float, ...]
    interrupted: bool

    @property
    def evaluations(self) -> int:
        return len(self.losses)


def minimise(
    loss: Loss,
    coefficients: Coefficients,
    method: str | Optimiser = "lbfgs",
    iterations: int = 60,
    callback: Callable[[int, float, Coefficients], object] | None = None,
) -> Minimum:
    """Return the Minimum of a loss: a function that returns its value and its gradient.

    coefficients : to start from, one vector or a tuple of vectors.
    method : an `Optimiser`, such as `optics.Adam(step=1e-3)`; "lbfgs" and "adam" stand for `LBFGS()` and
        `Adam()`.
    callback : called after every step with its number, the least loss and the best coefficients so far;
        StopIteration ends the work.

    Meanwhile BLAS takes one thread.  Ctrl-C ends the work too, and the best coefficients so far are returned.

    Raises UserError : an unknown method, a negative number of iterations, coefficients that are no vectors,
        or a loss that does not return a number and a gradient of the same shape.
    Raises NumericalError : a loss or gradient that is not finite.
    """
    if isinstance(iterations, bool) or not isinstance(iterations, Integral) or iterations < 0:
        raise UserError(f"iterations must be a whole number from 0 on, got {iterations!r}")
    optimiser, search = _optimiser(method), _Search(loss, coefficients, callback)
    try:
        with one_blas_thread():
            optimiser.run(search, search.start, iterations, search.stepped)
    except KeyboardInterrupt:
        if not search.losses:
            raise
        return search.minimum(True)
    return search.minimum(False)


def _optimiser(method: str | Optimiser) -> Optimiser:
    if isinstance(method, str) and method in METHODS:
        return METHODS[method]()
    if not hasattr(method, "run") or isinstance(method, type):
        names = ", ".join(map(repr, METHODS))
        raise UserError(
            f"method must be one of {names}, or an optimiser such as optics.Adam(), got {method!r}"
        )
    return method


def _vector(row: object) -> Floats:
    vector = real_numbers(row, "coefficients")
    if vector.ndim != 1:
        raise UserError(f"coefficients must be a vector or a tuple of vectors, got the shape {vector.shape}")
    return vector.copy()


class _Search:
    """A loss as a function of one vector, and the best of what was seen."""

    def __init__(
        self,
        loss: Loss,
        coefficients: Coefficients,
        callback: Callable[[int, float, Coefficients], object] | None,
    ) -> None:
        rows = coefficients if isinstance(coefficients, tuple) else (coefficients,)
        self._first = [_vector(row) for row in rows]
        self._ends = np.cumsum([len(row) for row in self._first])[:-1]
        self._loss, self._callback = loss, callback
        self._best, self._steps = (np.inf, self._first), 0
        self.losses: list[float] = []
        self.start = np.concatenate(self._first)

    def __call__(self, x: Floats) -> tuple[float, Floats]:
        rows = [row.copy() for row in np.split(x, self._ends)]
        try:
            value, gradient = self._loss(packed(rows))
            parts = gradient if isinstance(gradient, tuple) else (gradient,)
            value, gradients = float(floats(value)), [floats(g) for g in parts]
        except (TypeError, ValueError) as error:
            raise UserError(f"the loss must return a number and its gradient: {error}") from None
        if [g.shape for g in gradients] != [row.shape for row in rows]:
            shapes = ", ".join(str(g.shape) for g in gradients)
            wanted = ", ".join(str(row.shape) for row in rows)
            raise UserError(
                f"the loss's gradient must have the shape {wanted} of the coefficients, got {shapes}"
            )
        if not (np.isfinite(value) and all(np.isfinite(g).all() for g in gradients)):
            raise NumericalError("the loss or its gradient is not finite; start from another surface")
        if value < self._best[0]:
            self._best = value, rows
        self.losses.append(value)
        return value, np.concatenate(gradients)

    def stepped(self, _: Floats) -> None:
        """Tell the callback of a step."""
        self._steps += 1
        if self._callback is not None:
            self._callback(self._steps, self._best[0], packed(self._best[1]))

    def minimum(self, interrupted: bool) -> Minimum:
        value, rows = self._best
        return Minimum(packed(rows), value, tuple(self.losses), interrupted)
