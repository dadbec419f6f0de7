"""What all optimisers of a function with its gradient have in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeGuard

import numpy as np

from optics.base.runtime import UserError
from thbcad.checks import Floats

Function = Callable[[Floats], tuple[float, Floats]]  # x -> value and gradient
Callback = Callable[[Floats], object]  # after every step; StopIteration ends the work


class Optimiser(Protocol):
    """A way to lower a function of many variables by its gradient.

    >>> class Halving:
    ...     def run(self, function, start, iterations, callback):
    ...         for k in range(iterations + 1):
    ...             function(start / 2**k)
    ...         return iterations
    >>> minimise(lambda c: (c @ c, 2 * c), np.array([8.0]), Halving(), iterations=3).coefficients
    array([1.])
    """

    def run(self, function: Function, start: Floats, iterations: int, callback: Callback) -> int:
        """Evaluate the function at better and better points, and return the number of steps.

        The caller keeps the best point that was seen.

        callback : is called after every step; a StopIteration that it raises ends the work.
        """
        ...


def require_step(step: object) -> None:
    """Raise UserError unless a step is a positive finite number."""
    if not _number(step) or not 0 < step < np.inf:
        raise UserError(f"step must be a positive number, got {step!r}")


def require_fraction(name: str, value: object) -> None:
    """Raise UserError unless a value lies from 0 to 1."""
    if not _number(value) or not 0 <= value <= 1:
        raise UserError(f"{name} must be a number from 0 to 1, got {value!r}")


def _number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
