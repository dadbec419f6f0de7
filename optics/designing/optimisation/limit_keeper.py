"""Optimisation that ends within the limits of manufacturing.

Limits add penalties at points, and certified everywhere.  Where a start or a minimum exceeds a limit:

1. the start is moved within the limits, as far as the penalties see them; limits that no start is found for
   add none any more;
2. the minimum is improved in a few passes of the augmented Lagrangian (`ShapePenalty.tightened`);
3. the result is moved within the limits at denser points, with more room until the limits are certified.

A move minimises the penalties alone, first over the heights of whole surfaces, which light hardly feels, then
over the optimiser's variables, which are scaled by what light feels; of the way it keeps what it needs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil

import numpy as np
from scipy.optimize import minimize

from optics.designing.optimisation.bounded_variables import BoundedVariables
from optics.designing.optimisation.stage_search import Found, Interrupted, Log, Search, minimised
from optics.designing.penalties import (
    ROOM,
    ShapePenalty,
    limited_metrics,
    limited_part,
    shape_penalty,
)
from optics.scene.limits import Miss, limit_misses
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.surfaces import THBSurface

PASSES = 3  # of the augmented Lagrangian at most
SHORTER = 0.5  # of the stage's iterations, in every pass
ROOMS = 6  # that are tried, of a limit: 0.001, 0.003, ... 0.24
MORE_ROOM = 3.0
LIFTS = 20  # iterations that find the heights of surfaces
FLAT = 1e-6  # of the penalty: what heights do not change, as they change no curvature but for rounding
MOVES = 400  # iterations of a move, at most
TRIES = 60  # lengths of a step: penalties of curvature begin suddenly, far below the first length
CUTS = 6  # halvings of a move's length, which then is 1.6 % too long at most
WORTH = 0.25  # of the loss of a start that misses limits: the most of one that is moved within them
SHARES = 1.0, 0.75, 0.5, 0.25, 0.0  # of the start's sags, the most that can be moved within the limits
INSIDE = 0.99  # of z_freedom
CUT = 0.01  # of z_freedom: less is not worth a sentence


class LimitKeeper:
    """Minimises the objective of a stage within the limits of a system's problem.

    note : called with a sentence where z_freedom is in the way.
    """

    def __init__(self, system: OpticalSystem, lens: Lens, note: Callable[[str], object]) -> None:
        self._system, self._lens, self._note = system, lens, note
        problem = system.problem
        free = system.free_elements(lens)
        parts = [limited_part(optic, shape, problem.limits) for optic, shape in free]
        self._dense, self._sags = shape_penalty(parts, fine=True), system.sags(lens)
        self._bounds = [freeform.freedom for freeform in system.freeforms]

    def minimised(self, search: Search, iterations: int, log: Log) -> tuple[tuple[THBSurface, ...], Found]:
        """Return the best sags that are found, within the limits where that can be, and the last search.

        Raises Interrupted : on Ctrl-C.  NumericalError : the loss is not finite.
        """
        asked = search.objective.shape
        if self._dense is None or asked is None:
            found = minimised(search, iterations, log)
            return found.sags, found
        sags = search.sags
        try:
            search = self.begun(search, log)
            shape, sags = search.objective.shape, search.sags
            assert shape is not None
            if left_out := [f"limits.{key}" for key in asked.keys if key not in shape.keys]:
                names = " and ".join(left_out)
                self._note(f"no surface is found that keeps {names}, so that the design leaves it out")
            found = minimised(search, iterations, log)
            sags = found.sags
            for _ in range(PASSES):
                if not shape.exceeded(_coefficients(sags)):
                    break
                shape = shape.tightened(_coefficients(sags))
                search = found.search.begun_again(sags, shape)
                found = minimised(search, ceil(SHORTER * iterations), log)
                sags = found.sags
            return self._certified(sags, found.search.variables.around(sags), shape.keys), found
        except KeyboardInterrupt:
            raise Interrupted(log.state(sags)) from None

    def begun(self, search: Search, log: Log) -> Search:
        """Return the search from within the limits, as far as a start there is found, without the others.

        A search that began beyond them would dent the surface where it could have moved as a whole.  Where
        the move spoils the light more than the limits were missed, the start stays: a dent beside the light
        keeps them better.
        """
        shape, coefficients = search.objective.shape, _coefficients(search.sags)
        if shape is None or not shape.exceeded(coefficients):
            return search
        search = search.preconditioned()
        sags, keys, cut_off = self._start(shape.with_rooms({}), search.variables)
        missing, moved = (search.objective(c).loss for c in (coefficients, _coefficients(sags)))
        log.evaluations += 2
        if moved > WORTH * missing:
            return search.begun_again(search.sags, shape.only(keys))
        if cut_off:
            self._note(cut_off)
        return search.begun_again(sags, shape.only(keys))

    def _start(
        self, penalty: ShapePenalty, variables: BoundedVariables
    ) -> tuple[tuple[THBSurface, ...], tuple[str, ...], str]:
        """Return the start moved within the limits, those that it keeps: all, or as many as are found one
        after the other, and a sentence where z_freedom cuts off much of it.

        A limit that no sag can keep would spoil the light, and the other limits, for nothing.
        """
        start = self._within(penalty, variables)
        if start:
            _, heights, cut = self._lifted(self._sags, penalty)
            said = ""
            if cut > CUT * min(self._bounds):
                shaped = self._system.shaped
                thickness = self._lens.thickness + (heights[-1] if shaped == "rear" else -heights[-1])
                key = self._system.problem.optic.key("thickness")
                said = (
                    f"to keep the limits the {shaped} moves by {heights[-1]:.2g} mm along z, and z_freedom "
                    f"cuts off {cut:.2g} mm of the sag: for better light --set {key}={thickness:.4g}"
                )
            return start, penalty.keys, said
        best = self._sags
        keys: tuple[str, ...] = ()
        for key in penalty.keys:
            start = self._within(penalty.only((*keys, key)), variables)
            if start:
                best, keys = start, (*keys, key)
        return best, keys, ""

    def _within(self, penalty: ShapePenalty, variables: BoundedVariables) -> tuple[THBSurface, ...] | None:
        """Return sags within the limits near the start, or near a share of it: less sag bends less."""
        for share in SHARES:
            sags = [THBSurface(sag.space, share * sag.coefficients) for sag in self._sags]
            if start := self._moved(sags, penalty, variables):
                return start
        return None

    def _certified(
        self, sags: tuple[THBSurface, ...], variables: BoundedVariables, keys: Sequence[str]
    ) -> tuple[THBSurface, ...]:
        """Return the sags moved within the certified limits of these keys; unchanged where that cannot be."""
        assert self._dense is not None
        dense, found, rooms = self._dense.only(keys), sags, dict[str, float]()
        for _ in range(ROOMS):
            shaped, lens = self._system.with_sags(self._lens, found)
            missed = {m.key for m in curable_misses(shaped, lens)}.intersection(keys)
            if not missed:
                return found
            rooms |= {key: MORE_ROOM * rooms[key] if key in rooms else ROOM for key in missed}
            moved = self._moved(sags, dense.with_rooms(rooms), variables)
            if not moved:
                break
            found = moved
        return sags

    def _moved(
        self, sags: Sequence[THBSurface], penalty: ShapePenalty, variables: BoundedVariables
    ) -> tuple[THBSurface, ...] | None:
        """Return sags near others that leave half the room of every limit; None where none are found."""
        coefficients, _, _ = self._lifted(sags, penalty)
        if not penalty.cleared(coefficients):
            lifted = tuple(THBSurface(s.space, c) for s, c in zip(sags, coefficients))
            coefficients = _bent(variables.around(lifted), penalty)
        if not penalty.cleared(coefficients):
            return None
        return tuple(THBSurface(sag.space, c) for sag, c in zip(sags, coefficients))

    def _lifted(
        self, sags: Sequence[THBSurface], penalty: ShapePenalty
    ) -> tuple[list[Floats], Floats, float]:
        """Return coefficients with the heights that keep most of the limits, the heights, and what is cut
        off, mm."""
        before, bounds = _coefficients(sags), [INSIDE * bound for bound in self._bounds]
        heights = _heights(before, bounds, penalty)
        lifted = [np.clip(c + h, -b, b) for c, h, b in zip(before, heights, bounds)]
        cut = max(float(np.abs(c + h - d).max()) for c, h, d in zip(before, heights, lifted))
        return lifted, heights, cut if heights.any() else 0.0


def curable_misses(system: OpticalSystem, lens: Lens) -> list[Miss]:
    """Return the limits that free elements may miss, but for those that no coefficient can mend."""
    problem = system.problem
    return [
        miss
        for optic, shape in system.free_elements(lens)
        for miss in limit_misses(problem.about(optic), limited_metrics(optic, shape, problem.limits))
        if miss.most > 0 and miss.key != "feature" and miss.surface in ("", *optic.free)
    ]


def _coefficients(sags: Sequence[THBSurface]) -> list[Floats]:
    return [sag.coefficients for sag in sags]


def _heights(before: list[Floats], bounds: Sequence[float], penalty: ShapePenalty) -> Floats:
    """Return the heights that make the penalty least when they are added to the surfaces, mm."""

    def loss_of(heights: Floats) -> tuple[float, Floats]:
        coefficients = [np.clip(c + h, -b, b) for c, h, b in zip(before, heights, bounds)]
        loss, gradients = penalty(coefficients)
        free = zip(gradients, coefficients, bounds)
        return loss, np.array([g[np.abs(c) < b].sum() for g, c, b in free])

    start = np.zeros(len(before))
    loss, slope = loss_of(start)
    if np.abs(slope * bounds).max() <= FLAT * loss:
        return start
    options = {"maxiter": LIFTS, "gtol": FLAT * loss / max(bounds)}
    least = minimize(loss_of, start, jac=True, method="BFGS", options=options)
    result: Floats = least.x if least.fun < loss else start
    return result


def _bent(variables: BoundedVariables, penalty: ShapePenalty) -> list[Floats]:
    """Return coefficients that are cleared, on the line from the variables' start to a least penalty."""

    def at(weights: Floats) -> list[Floats]:
        return variables.coefficients(weights)[0]

    start = penalty(at(variables.zeros()))[0]

    def loss_of(weights: Floats) -> tuple[float, Floats]:
        coefficients, slopes = variables.coefficients(weights)
        loss, gradients = penalty(coefficients)
        return loss / start, variables.gradient(gradients, slopes) / start

    def stop(weights: Floats) -> None:
        if penalty.cleared(at(weights)):
            raise StopIteration

    options = {"maxiter": MOVES, "maxls": TRIES, "gtol": 0.0, "ftol": 0.0}
    zeros = variables.zeros()
    found = minimize(loss_of, zeros, jac=True, method="L-BFGS-B", callback=stop, options=options).x
    if penalty.cleared(at(found)):
        low, high = 0.0, 1.0
        for _ in range(CUTS):
            middle = (low + high) / 2
            low, high = (low, middle) if penalty.cleared(at(middle * found)) else (middle, high)
        found = high * found
    return at(found)
