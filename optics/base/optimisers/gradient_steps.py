"""First-order methods of fixed step, by the optimisers of Dr.Jit in double precision.

With the gradient g of iteration i = 0, 1, ... (thesis section 4.2):

    gradient descent   p <- p - step decay^i g
    momentum           m <- b m + (1 - b) g,                          p <- p - step m
    RMSProp            v <- b v + (1 - b) g^2,                        p <- p - step g / (sqrt v + tiny)
    Adam               both means, divided by 1 - b^(i + 1),          p <- p - step m / (sqrt v + tiny)

tiny is EPSILON of the first gradient's greatest entry, so that a factor of the function changes neither
RMSProp nor Adam.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.base.optimisers.iterations import Callback, Function, require_fraction, require_step
from optics.base.runtime import load_backend
from thbcad.checks import Floats

EPSILON = 1e-12


class _Steps(ABC):
    """Iterations of an optimiser of Dr.Jit, whose step falls by a factor."""

    decay = 1.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name == "step":
                require_step(value)
            else:
                require_fraction(name, value)

    @abstractmethod
    def _made(self, opt: Any, tiny: float) -> Any:
        """Return the optimiser, of the module drjit.opt."""

    def run(self, function: Function, start: Floats, iterations: int, callback: Callback) -> int:
        """Return the number of steps, see `Optimiser`."""
        backend = load_backend("double", None)
        from drjit import opt

        x, optimiser = start.copy(), None
        for k in range(iterations):
            _, gradient = function(x)
            if optimiser is None:
                tiny = EPSILON * float(np.abs(gradient).max()) or 1.0  # a gradient of zeros moves nothing
                optimiser = self._made(opt, tiny)
                optimiser["x"] = backend.array(x)
                first = optimiser.lr
            optimiser.set_learning_rate(first * self.decay**k)
            backend.dr.set_grad(optimiser["x"], backend.array(gradient))
            optimiser.step()
            x = optimiser["x"].numpy()
            try:
                callback(x)
            except StopIteration:
                return k + 1
        function(x)  # the last step counts too
        return iterations


@dataclass(frozen=True)
class GradientDescent(_Steps):
    """Steps along the negative gradient, step * decay^i long per unit of gradient.

    >>> minimise(lambda c: (c @ c, 2 * c), np.array([8.0]), GradientDescent(0.25), iterations=3).coefficients
    array([1.])
    """

    step: float
    decay: float = 1.0

    def _made(self, opt: Any, tiny: float) -> Any:
        return opt.SGD(lr=self.step)


@dataclass(frozen=True)
class Momentum(_Steps):
    """Gradient descent along a running mean of gradients, which starts at zero and is not corrected for it.

    mean : what is left of the mean after a step.

    >>> minimise(lambda c: (c @ c, 2 * c), np.array([8.0]), Momentum(0.5, 0.5), iterations=1).coefficients
    array([4.])
    """

    step: float
    mean: float = 0.9

    def _made(self, opt: Any, tiny: float) -> Any:
        rate = self.step * (1 - self.mean)  # Dr.Jit adds gradients up where the mean weighs them
        return opt.SGD(lr=rate, momentum=self.mean)


@dataclass(frozen=True)
class RMSProp(_Steps):
    """Gradient descent with every entry of the gradient divided by its running root mean square.

    step : about the length of a step in every variable.  square : what is left of the mean after a step.

    Source: T. Tieleman, G. Hinton, Neural networks for machine learning, lecture 6.5 (2012).

    >>> minimise(lambda c: (9 * c @ c, 18 * c), np.array([8]), RMSProp(1.0, 0.75), iterations=1).coefficients
    array([6.])
    """

    step: float
    square: float = 0.999

    def _made(self, opt: Any, tiny: float) -> Any:
        return opt.RMSProp(lr=self.step, alpha=self.square, epsilon=tiny)


@dataclass(frozen=True)
class Adam(_Steps):
    """Running mean of the gradient over its running root mean square, both unbiased.

    step : about the length of a step in every variable.
    mean, square : what is left of the means after a step.

    Source: D. P. Kingma, J. Ba, Adam: a method for stochastic optimization, ICLR 2015.

    >>> minimise(lambda c: (c @ c, 2 * c), np.ones(1), Adam(0.25), iterations=1).coefficients
    array([0.75])
    """

    step: float = 0.01
    mean: float = 0.9
    square: float = 0.999

    def _made(self, opt: Any, tiny: float) -> Any:
        return opt.Adam(lr=self.step, beta_1=self.mean, beta_2=self.square, epsilon=tiny)
