"""The design loop: optimise a level, mark, refine, go on.

Level by level the surface gets more degrees of freedom, and the measurement finer pixels and
more rays.  There are two ways to start a level:

- flat: the first level starts from the base conic, every other from the exact surface of the
  one before (prolongation);
- transport: every level starts from the optimal-transport surface fitted in its own space.  The
  levels before the last then need no optimisation, only the marking of cells.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from optics.optimisation.bounded_variables import BoundedVariables
from optics.optimisation.level_objective import PROBES, Indicators, marked_cells, stage_objective
from optics.optimisation.stage_plan import last_level, stages
from optics.optimisation.state import Row, State, first_state
from optics.optimisation.symmetry import mirror_axes
from optics.optimisation.transport_start import TransportStart
from optics.runtime import NumericalError, UserError
from optics.system import base_lens, freeforms, problem_rays, source_profile, target_irradiance, target_screen
from optics.tracing import Tracer
from thbcad.lens import require_sound
from thbcad.surfaces import THBSurface

if TYPE_CHECKING:
    from optics.optimisation.objective import Objective
    from optics.optimisation.stage_plan import Stage
    from optics.problem import Problem
    from optics.runtime import Backend
    from thbcad.lens import Lens

LEAST_SHARE = 1e-3  # of a level's changes; below it they are not worth keeping


class Interrupted(Exception):
    """The run was stopped by the user; `state` holds the best surfaces of the level so far."""

    def __init__(self, state: State) -> None:
        super().__init__("interrupted")
        self.state = state


def transmitted_flux(backend: Backend, problem: Problem, lens: Lens) -> float:
    """Return the flux that the unoptimised lens sends on, W.

    Raises
    ------
    UserError : (almost) nothing passes the lens.
    """
    tracer = Tracer(backend, lens, problem_rays(problem, (129, 129)), problem.target_z)
    _, landing = tracer.trace([sag.coefficients for sag in lens.sags])
    budget = tracer.budget(landing, problem.target.half_width)
    if budget.transmitted < 1e-3 * problem.source.flux:
        raise UserError(
            f"only {budget.transmitted:.3g} W of {problem.source.flux:.3g} W pass the unoptimised lens "
            f"(totally reflected {budget.total_internal:.3g} W, past the rear surface "
            f"{budget.missed_rear:.3g} W); "
            "change the lens prescription"
        )
    return budget.transmitted


def design(
    problem: Problem,
    light: NDArray[np.float64],
    backend: Backend,
    state: State | None = None,
    progress: Callable[[Sequence[Stage], Stage, Row], None] | None = None,
    checkpoint: Callable[[State], None] | None = None,
    note: Callable[[str], None] | None = None,
) -> tuple[Lens, State]:
    """Optimise the free surfaces of a problem's lens and return (Lens, State).

    light : the target picture as linear light.  state : to go on from, or None.
    progress : called with (every Stage, this Stage, Row) after every evaluation.
    checkpoint : called with the State after every level.
    note : called with a sentence where the problem itself limits the result.

    Raises
    ------
    Interrupted : on Ctrl-C.  NumericalError : the loss is not finite, or the surfaces that a level starts
        from cross.
    """
    lens = base_lens(problem)
    flux = transmitted_flux(backend, problem, lens)
    clock = perf_counter() - (state.seconds if state else 0.0)
    target = target_irradiance(light, target_screen(problem), problem.target.placing, 1.0)
    axes = mirror_axes(target, source_profile(problem))
    last = last_level(problem)
    # such a state needs neither a start nor coarse pixels
    on_its_way = state is not None and (state.level > last or (state.begun and state.level == last))
    start = None if on_its_way else _transport_start(problem, lens, light, backend, note)
    plan = stages(problem, start is not None)
    state = state or first_state(problem, lens, start is not None)
    remaining = [stage for stage in (plan[-1:] if on_its_way else plan) if stage.level >= state.level]
    for stage in remaining:
        if start and not state.begun:
            state = State(
                stage.level, (*state.sags[:-1], start.fit(state.sags[-1].space)), history=state.history
            )
        target = target_irradiance(light, stage.screen, problem.target.placing, flux)
        lens = _with_sags(lens, state.sags)
        objective = stage_objective(backend, problem, lens, stage, target)
        variables = BoundedVariables(state.sags, [f.z_freedom for f in freeforms(problem)], axes)
        recorder = _Recorder(
            objective, variables, stage, state, clock, partial(progress, plan) if progress else None
        )
        again = (
            not stage.final and stage.level == plan[-1].level
        )  # a coarse pass, which is better off without the scale
        try:
            lens, wrong = nearest_lens(lens, _minimize(recorder, problem, stage, not again))
        except Interrupted as stop:
            stop.state.sags = nearest_lens(lens, stop.state.sags)[0].sags
            raise
        if note and wrong:
            note(f"level {stage.level}: {wrong}; lower z_freedom of the free surfaces for a better result")
        try:
            marked = marked_cells(problem, lens, stage, axes, Indicators(problem, backend, target, start))
        except KeyboardInterrupt:
            raise Interrupted(State(stage.level, lens.sags, True, state.history)) from None
        sags = tuple(sag.refine(cells) for sag, cells in zip(lens.sags, marked))
        state = State(stage.level if again else stage.level + 1, sags, again, state.history)
        if checkpoint:
            checkpoint(state)
    if note and start and start.note:
        note(start.note)
    return _with_sags(lens, state.sags), state


def _transport_start(
    problem: Problem,
    lens: Lens,
    light: NDArray[np.float64],
    backend: Backend,
    note: Callable[[str], None] | None,
) -> TransportStart | None:
    """Return the start by optimal transport, or None where the problem asks for a flat one or the map asks
    for too much sag."""
    if problem.optimizer.start == "flat":
        return None
    start = TransportStart(problem, lens, light, backend)
    if start.parallel or start.within:
        return start
    if note:
        note(start.note + "; the design starts from the base surface instead")
    return None


class _Recorder:
    """Calls the objective, keeps the history and the best coefficients."""

    def __init__(
        self,
        objective: Objective,
        variables: BoundedVariables,
        stage: Stage,
        state: State,
        clock: float,
        progress: Callable[[Stage, Row], None] | None,
    ) -> None:
        self._objective, self.variables = objective, variables
        self._stage, self._clock, self._progress = stage, clock, progress
        self.state, self._before = state, state.evaluations
        self.best = np.inf, [sag.coefficients for sag in state.sags]

    @property
    def best_sags(self) -> tuple[THBSurface, ...]:
        return tuple(THBSurface(sag.space, c) for sag, c in zip(self.state.sags, self.best[1]))

    def precondition(self, seed: int) -> None:
        """Scale the variables by the curvature at the start."""
        self.variables.precondition(self._objective.curvature(self.best[1], PROBES, seed))

    def __call__(self, weights: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        coefficients = self.variables.coefficients(weights)
        loss, gradient = self._objective(coefficients)
        if not (np.isfinite(loss) and all(np.isfinite(g).all() for g in gradient)):
            raise NumericalError(
                f"the loss is not finite at level {self._stage.level}; lower z_freedom or check the "
                "prescription"
            )
        if loss < self.best[0]:
            self.best = loss, coefficients
        history = self.state.history
        row = Row(
            self._stage.level,
            sum(map(len, coefficients)),
            self._before + self._objective.evaluations,
            loss,
            self._objective.fit,
            perf_counter() - self._clock,
        )
        history.append(row)
        if self._progress:
            self._progress(self._stage, row)
        return loss, self.variables.gradient(gradient)


def _minimize(recorder: _Recorder, problem: Problem, stage: Stage, scaled: bool) -> tuple[THBSurface, ...]:
    """Return the best sags that L-BFGS finds; scaled : by the curvature at the start."""
    options = {
        "maxiter": stage.iterations,
        "maxcor": problem.optimizer.memory,
        "maxfun": 2 * stage.iterations + 10,
        "gtol": 0.0,
    }
    try:
        if stage.iterations == 0:
            recorder(recorder.variables.zeros())
            return recorder.best_sags
        if scaled:
            recorder.precondition(problem.run.seed)
        minimize(recorder, recorder.variables.zeros(), jac=True, method="L-BFGS-B", options=options)
    except KeyboardInterrupt:
        raise Interrupted(State(stage.level, recorder.best_sags, True, recorder.state.history)) from None
    return recorder.best_sags


def nearest_lens(lens: Lens, sags: Sequence[THBSurface]) -> tuple[Lens, str]:
    """Return the lens with other sags and "", or, where it cannot exist, one on the way there and a sentence
    that says why.

    The way from the lens's own sags, c + t (c' - c), is halved until a lens can exist.
    """
    try:
        return require_sound(lens.with_sags(sags)), ""
    except ValueError as error:
        wrong = str(error)
    share = 1.0
    while share > LEAST_SHARE:
        share /= 2
        between = [
            THBSurface(a.space, a.coefficients + share * (b.coefficients - a.coefficients))
            for a, b in zip(lens.sags, sags)
        ]
        try:
            return (
                require_sound(lens.with_sags(between)),
                f"the optimised lens cannot exist ({wrong}): of the level's changes {share:.2g} are kept",
            )
        except ValueError:
            continue
    return lens, f"the optimised lens cannot exist ({wrong}): none of the level's changes are kept"


def _with_sags(lens: Lens, sags: Sequence[THBSurface]) -> Lens:
    try:
        return require_sound(lens.with_sags(sags))
    except ValueError as error:
        raise NumericalError(
            f"the optimised lens cannot exist: {error}; lower z_freedom of the free surfaces"
        ) from None
