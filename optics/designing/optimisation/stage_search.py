"""The search of a stage: its objective lowered over bounded variables, and a row for every evaluation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from optics.base.optimisers import LBFGS, Adam
from optics.base.runtime import NumericalError
from optics.designing.optimisation.bounded_variables import BoundedVariables
from optics.designing.optimisation.objective import Evaluation, Objective
from optics.designing.optimisation.stage_plan import Stage
from optics.designing.optimisation.state import Row, State
from optics.designing.penalties import ShapePenalty
from optics.scene.problem import Problem
from thbcad.checks import Floats
from thbcad.surfaces import THBSurface

STEPS = 10  # over which the fall of the misfit is looked at
FLAT = 1e-4  # fall per step, relative: below it more steps are not worth their time


class Interrupted(Exception):
    """The run was stopped by the user; `state` holds the best surfaces of the stage so far."""

    def __init__(self, state: State) -> None:
        super().__init__("interrupted")
        self.state = state


class Log:
    """The history of a run up to now; `add` makes a row of an evaluation.

    state : that the stage starts from.  clock : `perf_counter()` at the start of the run.
    report : called with every new Row.
    """

    def __init__(self, state: State, stage: Stage, clock: float, report: Callable[[Row], object]) -> None:
        self._state, self._stage, self._clock, self._report = state, stage, clock, report
        self.rows = list(state.history)
        self.evaluations = state.evaluations

    def add(self, evaluation: Evaluation, dof: int) -> None:
        """Add the row of an evaluation.

        Raises NumericalError : its loss or gradient is not finite.
        """
        level = self._stage.level
        if not (np.isfinite(evaluation.loss) and all(np.isfinite(g).all() for g in evaluation.gradients)):
            raise NumericalError(
                f"the loss is not finite at level {level}; lower z_freedom or check the prescription"
            )
        self.evaluations += 1
        seconds = perf_counter() - self._clock
        row = Row(
            level, dof, self.evaluations, evaluation.loss, evaluation.fit, seconds, stage=self._state.stage
        )
        self.rows.append(row)
        self._report(row)

    def state(self, sags: Sequence[THBSurface]) -> State:
        """Return the state of the stage with other sags and the rows so far."""
        return replace(self._state, sags=tuple(sags), history=tuple(self.rows))


@dataclass(frozen=True, eq=False)
class Search:
    """What is lowered, and where it begins.

    sags : the start.  variables : around it.
    curvature : of the fit where the stage starts, as of `Objective.curvature`; None: the variables know it.
    """

    problem: Problem
    objective: Objective
    variables: BoundedVariables
    sags: tuple[THBSurface, ...]
    curvature: Sequence[Sequence[Floats]] | None

    def preconditioned(self) -> Search:
        """Return the search with variables scaled by the fit's curvature."""
        if self.curvature is None:
            return self
        return replace(self, variables=self.variables.preconditioned(self.curvature), curvature=None)

    def begun_again(self, sags: Sequence[THBSurface], shape: ShapePenalty | None) -> Search:
        """Return the search from other sags, with another penalty on the shape."""
        objective, variables = self.objective.with_shape(shape), self.variables.around(sags)
        return replace(self, objective=objective, variables=variables, sags=tuple(sags))


@dataclass(frozen=True, eq=False)
class Found:
    """Where a search ended.

    search : with the scale of its variables.  coefficients : the best of every sag.  row : in the log.
    fall : by what fraction the root of the loss fell per step where its number of steps ended it, or 0;
        0 too after fewer than STEPS steps.
    """

    search: Search
    coefficients: list[Floats]
    row: int
    fall: float = 0.0

    @property
    def sags(self) -> tuple[THBSurface, ...]:
        """The best sags."""
        return tuple(THBSurface(sag.space, c) for sag, c in zip(self.search.sags, self.coefficients))


def minimised(search: Search, iterations: int, log: Log) -> Found:
    """Return the best sags that the problem's method finds from the start of a search.

    Weights are scaled by the fit's curvature where the stage starts, if the fit is most of the loss here.
    L-BFGS stops where the root of the loss fell by less than FLAT per step, over STEPS steps.

    Raises Interrupted : on Ctrl-C.  NumericalError : the loss is not finite.
    """
    options = search.problem.optimizer
    best = Found(search, [sag.coefficients for sag in search.sags], len(log.rows))
    least = np.inf
    after_steps: list[float] = []  # the least loss after every step

    def evaluated(coefficients: list[Floats]) -> Evaluation:
        nonlocal best, least
        evaluation = search.objective(coefficients)
        if evaluation.loss < least:
            best, least = Found(search, coefficients, len(log.rows)), evaluation.loss
        log.add(evaluation, sum(map(len, coefficients)))
        return evaluation

    def by_weights(weights: Floats) -> tuple[float, Floats]:
        coefficients, slopes = search.variables.coefficients(weights)
        evaluation = evaluated(coefficients) if weights.any() else first
        return evaluation.loss, search.variables.gradient(evaluation.gradients, slopes)

    def after_step(_: Floats) -> None:
        after_steps.append(least)
        if options.method != "adam" and len(after_steps) > STEPS and _fall_per_step(after_steps) < FLAT:
            raise StopIteration

    try:
        first = evaluated(search.variables.coefficients(search.variables.zeros())[0])
        if 2 * (first.fit**2 + first.zones) > first.loss:
            search = search.preconditioned()
        method = Adam(options.step) if options.method == "adam" else LBFGS(options.memory)
        steps = method.run(by_weights, search.variables.zeros(), iterations, after_step)
    except KeyboardInterrupt:
        raise Interrupted(log.state(best.sags)) from None
    fall = _fall_per_step(after_steps) if steps >= iterations else 0.0
    return replace(best, search=search, fall=fall)


def _fall_per_step(least: Sequence[float]) -> float:
    """Return by which fraction the root of the loss fell per step, over the last steps."""
    last = least[-STEPS - 1 :]
    if len(last) <= STEPS or last[0] <= 0:
        return 0.0
    return float(1 - (last[-1] / last[0]) ** (0.5 / STEPS))
