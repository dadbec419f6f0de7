"""Minimisers of a function with its gradient, one interface for all: scipy's L-BFGS, and Adam."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

Floats = NDArray[np.float64]
Function = Callable[[Floats], tuple[float, Floats]]  # x -> value and gradient
Callback = Callable[[Floats], None]  # after every step; StopIteration ends the work

MEANS = 0.9, 0.999  # decay of Adam's means of the gradient and of its square
LEAST = 1e-12  # of the greatest root mean square of a gradient's entry: what Adam divides by


def lbfgs(
    function: Function,
    start: Floats,
    iterations: int,
    callback: Callback,
    memory: int = 10,
    least_decrease: float | None = None,
) -> int:
    """Run L-BFGS-B and return the steps taken.

    memory : pairs that are kept.  least_decrease : of the value in a step, that is worth another one.
    """
    options = {"maxiter": iterations, "maxcor": memory, "maxfun": 2 * iterations + 10, "gtol": 0.0}
    if least_decrease is not None:
        options["ftol"] = least_decrease
    result = minimize(function, start, jac=True, method="L-BFGS-B", options=options, callback=callback)
    return int(result.nit)


def adam(
    function: Function,
    start: Floats,
    iterations: int,
    callback: Callback,
    step: float,
) -> int:
    """Run Adam and return the steps taken: x <- x - step m / (sqrt v + tiny), with unbiased means m and v.

    step : length of a step in every variable, about.

    Source: D. P. Kingma, J. Ba, Adam: a method for stochastic optimization, ICLR 2015.
    """
    x = start.copy()
    mean, square = np.zeros_like(x), np.zeros_like(x)
    for k in range(1, iterations + 1):
        _, gradient = function(x)
        mean += (1 - MEANS[0]) * (gradient - mean)
        square += (1 - MEANS[1]) * (gradient**2 - square)
        root = np.sqrt(square / (1 - MEANS[1] ** k))
        tiny = LEAST * root.max() or 1.0  # a gradient of zeros moves nothing
        x = x - step * (mean / (1 - MEANS[0] ** k)) / (root + tiny)
        try:
            callback(x)
        except StopIteration:
            return k
    function(x)  # the last step counts too
    return iterations
