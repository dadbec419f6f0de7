"""Optimisation that ends within the limits of manufacturing.

Limits are charged at points, and certified everywhere.  Where a start or a minimum exceeds a limit:

1. the start is moved within the limits, as far as the charges see them;
2. the minimum is improved in a few passes of the augmented Lagrangian (`ShapePenalty.tightened`);
3. the result is moved within the limits at denser points, with more room until the limits are certified.

A move minimises the charges alone, first over the heights of whole surfaces, which light hardly feels, then
over the optimiser's variables, which are scaled by what light feels; of the way it keeps what it needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from optics.problem import limit_misses
from optics.shape import ROOM, shape_penalty
from thbcad.lens import manufacturability
from thbcad.surfaces import THBSurface

if TYPE_CHECKING:
    from optics.optimisation.bounded_variables import BoundedVariables
    from optics.optimisation.recorder import Recorder
    from optics.problem import Miss, Problem
    from optics.shape import ShapePenalty
    from optics.system import OpticalSystem
    from thbcad.lens import Lens

PASSES = 3  # of the augmented Lagrangian at most
SHORTER = 0.5  # of the stage's iterations, in every pass
ROOMS = 6  # that are tried, of a limit: 0.001, 0.003, ... 0.24
MORE_ROOM = 3.0
MOVES = 100  # iterations of a move
CUTS = 6  # halvings of a move's length, which then is 1.6 % too long at most
INSIDE = 0.99  # of z_freedom

Floats = NDArray[np.float64]


class LimitKeeper:
    """Minimises the objective of a stage within the limits of a system's problem."""

    def __init__(self, system: OpticalSystem, lens: Lens) -> None:
        self._system, self._lens = system, lens
        problem = system.problem
        self._dense = shape_penalty(lens, problem.limits, problem.lens.density, fine=True)

    def minimized(self, recorder: Recorder, iterations: int) -> tuple[THBSurface, ...]:
        """Return the best sags that are found, within the limits where that can be.

        Raises
        ------
        Interrupted : on Ctrl-C.  NumericalError : the loss is not finite.
        """
        shape = recorder.shape
        if self._dense is None or shape is None:
            return recorder.minimized()
        try:
            passes = PASSES
            if shape.exceeded(_coefficients(self._lens.sags)):
                recorder.precondition()
                start = self._moved(self._lens.sags, shape.with_rooms({}), recorder.variables)
                if start:
                    recorder.go_on(start, shape)
                else:
                    passes = 0  # multipliers of what cannot be met would grow without end
            sags = recorder.minimized()
            for _ in range(passes):
                if not shape.exceeded(_coefficients(sags)):
                    break
                shape = shape.tightened(_coefficients(sags))
                recorder.go_on(sags, shape)
                sags = recorder.minimized(ceil(SHORTER * iterations))
            return self._certified(sags, recorder.variables.around(sags))
        except KeyboardInterrupt:
            raise recorder.stopped from None

    def _certified(self, sags: tuple[THBSurface, ...], variables: BoundedVariables) -> tuple[THBSurface, ...]:
        """Return the sags moved within the certified limits; unchanged where that cannot be."""
        assert self._dense is not None
        found, rooms = sags, dict[str, float]()
        for _ in range(ROOMS):
            missed = {m.key for m in chargeable_misses(self._system.problem, self._lens.with_sags(found))}
            if not missed:
                return found
            rooms |= {key: MORE_ROOM * rooms[key] if key in rooms else ROOM for key in missed}
            moved = self._moved(sags, self._dense.with_rooms(rooms), variables)
            if not moved:
                break
            found = moved
        return sags

    def _moved(
        self, sags: Sequence[THBSurface], charges: ShapePenalty, variables: BoundedVariables
    ) -> tuple[THBSurface, ...] | None:
        """Return sags near others that leave half the room of every charge; None where none are found."""
        before = _coefficients(sags)
        bounds = [INSIDE * freeform.freedom for freeform in self._system.freeforms]
        coefficients = _lifted(before, bounds, charges)
        if not charges.cleared(coefficients):
            lifted = tuple(THBSurface(s.space, c) for s, c in zip(sags, coefficients))
            coefficients = _bent(variables.around(lifted), charges)
        if not charges.cleared(coefficients):
            return None
        return tuple(THBSurface(sag.space, c) for sag, c in zip(sags, coefficients))


def chargeable_misses(problem: Problem, lens: Lens) -> list[Miss]:
    """Return the limits that a lens may miss, but for those that no coefficient can mend."""
    free = {"", "rear"} if lens.front.sag is None else {"", "front", "rear"}
    metrics = manufacturability(lens, problem.lens.density or None)
    missed = [m for m in limit_misses(problem, metrics) if m.most > 0]
    return [m for m in missed if m.key != "feature" and m.surface in free]


def _coefficients(sags: Sequence[THBSurface]) -> list[Floats]:
    return [sag.coefficients for sag in sags]


def _lifted(before: list[Floats], bounds: Sequence[float], charges: ShapePenalty) -> list[Floats]:
    """Return coefficients with a height added to every surface, which makes the charges least."""

    def lifted(heights: Floats) -> list[Floats]:
        return [np.clip(c + h, -b, b) for c, h, b in zip(before, heights, bounds)]

    def charge(heights: Floats) -> tuple[float, Floats]:
        coefficients = lifted(heights)
        loss, gradients = charges(coefficients)
        free = zip(gradients, coefficients, bounds)
        return loss, np.array([g[np.abs(c) < b].sum() for g, c, b in free])

    least = minimize(charge, np.zeros(len(before)), jac=True, method="BFGS", options={"gtol": 0.0})
    return lifted(least.x) if least.fun < charges(before)[0] else before


def _bent(variables: BoundedVariables, charges: ShapePenalty) -> list[Floats]:
    """Return coefficients that are cleared, on the line from the variables' start to a least charge."""

    def at(weights: Floats) -> list[Floats]:
        return variables.coefficients(weights)[0]

    start = charges(at(variables.zeros()))[0]

    def charge(weights: Floats) -> tuple[float, Floats]:
        coefficients, slopes = variables.coefficients(weights)
        loss, gradients = charges(coefficients)
        return loss / start, variables.gradient(gradients, slopes) / start

    def stop(weights: Floats) -> None:
        if charges.cleared(at(weights)):
            raise StopIteration

    options = {"maxiter": MOVES, "gtol": 0.0, "ftol": 0.0}
    zeros = variables.zeros()
    found = minimize(charge, zeros, jac=True, method="L-BFGS-B", callback=stop, options=options).x
    if charges.cleared(at(found)):
        low, high = 0.0, 1.0
        for _ in range(CUTS):
            middle = (low + high) / 2
            low, high = (low, middle) if charges.cleared(at(middle * found)) else (middle, high)
        found = high * found
    return at(found)
