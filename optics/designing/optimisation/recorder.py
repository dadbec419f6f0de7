"""One stage of the optimiser: calls the objective, keeps the history and the best coefficients."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.base.optimisers import LBFGS, Adam
from optics.base.runtime import NumericalError
from optics.designing.optimisation.bounded_variables import BoundedVariables
from optics.designing.optimisation.stage_plan import PROBES
from optics.designing.optimisation.state import Row, State
from thbcad.surfaces import THBSurface

if TYPE_CHECKING:
    from optics.designing.optimisation.objective import Evaluation, Objective
    from optics.designing.optimisation.stage_plan import Stage
    from optics.designing.penalties import ShapePenalty
    from optics.scene.system import OpticalSystem


STEPS = 10  # over which the fall of the misfit is looked at
FLAT = 1e-4  # fall per step, relative: below it more steps are not worth their time
LEAST_DECREASE = 2.2e-9  # of the loss: it ends a run that starts near a minimum


class Interrupted(Exception):
    """The run was stopped by the user; `state` holds the best surfaces of the stage so far."""

    def __init__(self, state: State) -> None:
        super().__init__("interrupted")
        self.state = state


class Recorder:
    """A stage's objective by the optimiser's variables; call it with weights.

    state : that the stage starts from.  axes : directions of mirror symmetry that is kept.
    clock : `perf_counter()` at the start of the run.  progress : called with the Row after every call.
    """

    def __init__(
        self,
        system: OpticalSystem,
        objective: Objective,
        stage: Stage,
        state: State,
        axes: Sequence[int],
        clock: float,
        progress: Callable[[Row], None] | None = None,
    ) -> None:
        self._problem, self._objective, self._stage = system.problem, objective, stage
        self._variables = BoundedVariables(state.sags, [f.freedom for f in system.freeforms], axes)
        self._state, self._clock, self._progress = state, clock, progress
        self._rows = list(state.history)
        self._evaluations = state.evaluations
        self._best = np.inf, [sag.coefficients for sag in state.sags]
        self._best_row = 0
        self._first: Evaluation | None = None
        self._bests: list[float] = []  # least loss after every step of the optimiser
        self.fall = 0.0
        self._scaled = False
        self._gone_on = False

    @property
    def history(self) -> tuple[Row, ...]:
        """The rows of this stage behind those of the stages before."""
        return tuple(self._rows)

    @property
    def variables(self) -> BoundedVariables:
        """The variables around the sags that `minimized` starts from."""
        return self._variables

    @property
    def shape(self) -> ShapePenalty | None:
        """What the objective charges the shape for."""
        return self._objective.shape

    @property
    def stopped(self) -> Interrupted:
        """What is raised on Ctrl-C."""
        return Interrupted(replace(self._state, sags=self._best_sags(), history=self.history))

    def go_on(self, sags: Sequence[THBSurface], shape: ShapePenalty | None) -> None:
        """Start the next `minimized` from other sags, with other charges for the shape."""
        self._objective = self._objective.charging(shape)
        self._variables = self._variables.around(sags)
        self._best = np.inf, [sag.coefficients for sag in sags]
        self._first = None
        self._gone_on = True
        self._bests, self.fall = [], 0.0

    def minimized(self, iterations: int = 0) -> tuple[THBSurface, ...]:
        """Return the best sags that the problem's method finds.

        Weights are scaled by the fit's curvature at the start, where the fit is most of the loss there.  It
        stops where the root of the loss fell by less than FLAT per step, over STEPS steps.  `fall` is then
        what it fell per step where it was stopped by the number of iterations, or else 0.  After fewer steps
        nothing is said.

        iterations : 0 for those of the stage.

        Raises
        ------
        Interrupted : on Ctrl-C.  NumericalError : the loss is not finite.
        """
        iterations, options = iterations or self._stage.iterations, self._problem.optimizer
        try:
            start, _ = self._variables.coefficients(self._variables.zeros())
            self._first = first = self._evaluated(start)
            if not self._scaled and 2 * first.fit**2 > first.loss:
                self.precondition()
            zeros = self._variables.zeros()
            if options.method == "adam":
                steps = Adam(options.step).run(self, zeros, iterations, self._keep_best)
            else:
                enough = LEAST_DECREASE * first.loss if self._gone_on else None  # scipy compares with 1
                method = LBFGS(options.memory, enough)
                steps = method.run(self, zeros, iterations, self._stop_where_flat)
            if steps >= iterations:
                self.fall = self._fall_per_step()
        except KeyboardInterrupt:
            raise self.stopped from None
        return self._best_sags()

    def measure_afresh(self, objective: Objective) -> None:
        """Note the fit of the result on the rays of another objective.

        The optimiser fits the noise of its own rays too.
        """
        fresh_fit = objective(self._best[1]).fit
        self._rows[self._best_row] = replace(self._rows[self._best_row], fresh_fit=fresh_fit)

    def _keep_best(self, _: NDArray[np.float64]) -> None:
        """Keep the least loss after a step of the optimiser."""
        self._bests.append(self._best[0])

    def _stop_where_flat(self, weights: NDArray[np.float64]) -> None:
        """Keep the least loss after a step of the optimiser, and end its work where that is flat."""
        self._keep_best(weights)
        if len(self._bests) > STEPS and self._fall_per_step() < FLAT:
            raise StopIteration

    def _fall_per_step(self) -> float:
        """Return by which fraction the root of the loss fell per step, over the last steps."""
        last = self._bests[-STEPS - 1 :]
        if len(last) <= STEPS or last[0] <= 0:
            return 0.0
        return float(1 - (last[-1] / last[0]) ** (0.5 / STEPS))

    def __call__(self, weights: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Return (loss, its gradient by the weights)."""
        coefficients, slopes = self._variables.coefficients(weights)
        evaluation = self._first
        if evaluation is None or weights.any():
            evaluation = self._evaluated(coefficients)
        return evaluation.loss, self._variables.gradient(evaluation.gradients, slopes)

    def _evaluated(self, coefficients: list[NDArray[np.float64]]) -> Evaluation:
        """Return the Evaluation, with a row in the history."""
        evaluation = self._objective(coefficients)
        if not (np.isfinite(evaluation.loss) and all(np.isfinite(g).all() for g in evaluation.gradients)):
            raise NumericalError(
                f"the loss is not finite at level {self._stage.level}; "
                "lower z_freedom or check the prescription"
            )
        if evaluation.loss < self._best[0]:
            self._best, self._best_row = (evaluation.loss, coefficients), len(self._rows)
        self._evaluations += 1
        row = Row(
            level=self._stage.level,
            dof=sum(map(len, coefficients)),
            evaluation=self._evaluations,
            loss=evaluation.loss,
            fit=evaluation.fit,
            seconds=perf_counter() - self._clock,
            stage=self._state.stage,
        )
        self._rows.append(row)
        if self._progress:
            self._progress(row)
        return evaluation

    def precondition(self) -> None:
        """Scale the variables by the fit's curvature at the best sags so far."""
        vectors = self._objective.curvature(self._best[1], PROBES, self._problem.run.seed)
        self._evaluations += PROBES
        self._variables = self._variables.preconditioned(vectors)
        self._scaled = True

    def _best_sags(self) -> tuple[THBSurface, ...]:
        return tuple(THBSurface(sag.space, c) for sag, c in zip(self._state.sags, self._best[1]))
