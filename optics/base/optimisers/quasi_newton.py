"""L-BFGS-B of scipy."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.optimize import minimize

from optics.base.optimisers.iterations import Callback, Function
from optics.base.runtime import UserError
from thbcad.checks import Floats


@dataclass(frozen=True)
class LBFGS:
    """Quasi-Newton steps: the Hessian is built from the last pairs of steps and changes of the gradient.

    memory : pairs that are kept.
    least_decrease : of the value in a step that is worth another one, relative; None is scipy's own.

    Source: R. H. Byrd, P. Lu, J. Nocedal, C. Zhu, SIAM J. Sci. Comput. 16 (1995) 1190-1208.
    """

    memory: int = 10
    least_decrease: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.memory, int) or isinstance(self.memory, bool) or self.memory < 1:
            raise UserError(f"memory must be a whole number from 1 on, got {self.memory!r}")

    def run(self, function: Function, start: Floats, iterations: int, callback: Callback) -> int:
        """Return the number of steps, see `Optimiser`."""
        options = {
            "maxiter": iterations,
            "maxcor": self.memory,
            "maxfun": 2 * iterations + 10,
            "gtol": 0.0,
        }
        if self.least_decrease is not None:
            options["ftol"] = self.least_decrease
        result = minimize(function, start, jac=True, method="L-BFGS-B", options=options, callback=callback)
        return int(result.nit)
