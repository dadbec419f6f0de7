"""The design loop: optimise a level, mark, refine, go on.

Level by level the surface gets more degrees of freedom, and the measurement finer pixels and
more rays.  There are two ways to start a level:

- flat: the first level starts from the base conic, every other from the exact surface of the
  one before (prolongation);
- transport: every level starts from the optimal-transport surface fitted in its own space.  The
  levels before the last then need no optimisation, only the marking of cells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import ceil, gcd
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from optics.errors import NumericalError, UserError
from optics.model import base_lens, problem_beam, target_irradiance, target_screen
from optics.objective import Objective
from optics.problem import Problem, per_level
from optics.refinement import cell_indicator, mark, vertex_knots
from optics.start import TransportStart
from optics.tracing import Tracer
from optics.variables import BoundedVariables
from optics.windows import BSplineWindow, GaussianWindow, PixelWindow
from thbcad.thb import THBSurface

if TYPE_CHECKING:
    from optics.backend import Backend
    from optics.screen import Screen
    from thbcad.lens import Lens

MOST_RAYS = 40_000_000  # at once
COARSER, COARSE_PIXELS, COARSE_ITERATIONS = 4, 16, 20  # of a first pass on the last level, which carries light to islands in the dark
MARGIN = 8  # dark pixels around the target
PIXELS_PER_SPAN = 4  # a level's pixels are merged while this many remain per knot span


@dataclass(frozen=True)
class Row:
    """One evaluation in the history."""

    level: int
    dof: int
    evaluation: int
    loss: float
    fit: float
    seconds: float


@dataclass
class State:
    """What a run needs to go on: the next level to optimise and the surface it starts from.

    begun : the level was interrupted, `sag` is its best surface so far.
    """

    level: int
    sag: THBSurface
    begun: bool = False
    history: list[Row] = field(default_factory=list)

    @property
    def evaluations(self) -> int:
        return len(self.history)

    @property
    def seconds(self) -> float:
        return self.history[-1].seconds if self.history else 0.0


class Interrupted(Exception):
    """The run was stopped by the user; `state` holds the best surface of the level so far."""

    def __init__(self, state: State) -> None:
        super().__init__("interrupted")
        self.state = state


@dataclass(frozen=True, eq=False)
class Stage:
    """Pixels and rays of one level.

    final : the last one, with the window of the problem; the others take wide windows, which move light from afar.
    """

    level: int
    iterations: int
    screen: Screen
    rays: tuple[int, int]
    final: bool

    @property
    def evaluations(self) -> int:
        """Expected evaluations of loss and gradient."""
        return self.iterations + 1

    @property
    def work(self) -> int:
        """Expected cost, in rays traced."""
        return self.evaluations * self.rays[0] * self.rays[1]


def first_level(problem: Problem) -> int:
    """Return the level at which optimisation starts.

    A transport start makes the levels superfluous whose spans are wider than four pixels.
    """
    freeform = problem.lens.rear.freeform
    if not uses_transport(problem):
        return 0
    fine = [level for level in range(freeform.max_level + 1) if _coarsening(problem, level) == 1]
    return fine[0] if fine else freeform.max_level


def uses_transport(problem: Problem) -> bool:
    """Return whether the design starts from an optimal-transport map."""
    return problem.optimizer.start == "transport" and np.isinf(problem.lens.front.radius)


def stages(problem: Problem) -> list[Stage]:
    """Return the Stage of every level that is optimised."""
    out = []
    last, moved = problem.lens.rear.freeform.max_level, uses_transport(problem)
    for level in range(first_level(problem), last + 1):
        iterations = 0 if moved and level < last else per_level(problem.optimizer.iterations, level)
        if moved and level == last and iterations > 1 and min(problem.target.pixels) >= COARSER * COARSE_PIXELS:
            out.append(_stage(problem, level, min(COARSE_ITERATIONS, iterations), COARSER, False))
        out.append(_stage(problem, level, iterations, _coarsening(problem, level), level == last))
    return out


def _stage(problem: Problem, level: int, iterations: int, coarsening: int, final: bool) -> Stage:
    screen = target_screen(problem, coarsening, MARGIN)
    spans = [n << level for n in problem.lens.rear.freeform.spans]
    rays = tuple(max(64, ceil(problem.optimizer.rays_per_pixel * n), 2 * s) + 1 for n, s in zip(screen.pixels, spans))
    if rays[0] * rays[1] > MOST_RAYS:
        raise UserError(
            f"level {level} would trace {rays[0]} x {rays[1]} rays at once, too many for the memory of most machines; "
            "use fewer target.pixels, lens.rear.freeform.spans or levels, or fewer optimizer.rays_per_pixel"
        )
    return Stage(level, iterations, screen, rays, final)


def _coarsening(problem: Problem, level: int) -> int:
    """Return how many pixels a level merges in each direction, a power of 2."""
    spans = [n << level for n in problem.lens.rear.freeform.spans]
    coarsening = 1
    while all(n // (2 * coarsening) >= PIXELS_PER_SPAN * s for n, s in zip(problem.target.pixels, spans)):
        coarsening *= 2
    return coarsening


def first_state(problem: Problem, lens: Lens) -> State:
    """Return the State from which a new run starts: the first level's mesh, sag zero."""
    sag = lens.rear.sag
    for level in range(first_level(problem)):
        sag = sag.refine({level: sag.space.cells[:, 1:]})
    return State(first_level(problem), sag)


def earlier_state(problem: Problem, lens: Lens, earlier: Lens) -> State:
    """Return the State that optimises the rear surface of an earlier design on the last level, on its own mesh.

    Raises
    ------
    UserError : that surface has no sag, or one over another rectangle, conic or mesh.
    """
    sag, own = earlier.rear.sag, lens.rear.sag
    if sag is None:
        raise UserError("the earlier design has no freeform rear surface to start from")
    same = (
        earlier.rear.half_width == lens.rear.half_width
        and earlier.rear.conic == lens.rear.conic
        and all(
            a.degree == b.degree and np.array_equal(a.knots, b.knots)
            for a, b in ((sag.space.kv_u, own.space.kv_u), (sag.space.kv_v, own.space.kv_v))
        )
    )
    if not same:
        raise UserError(
            "the rear surface of the earlier design differs in half_width, radius, conic, degree or spans; "
            "make lens.rear equal to its problem.toml"
        )
    return State(problem.lens.rear.freeform.max_level, sag, begun=True)


def transmitted_flux(backend: Backend, problem: Problem, lens: Lens) -> float:
    """Return the flux that the unoptimised lens sends on, W.

    Raises
    ------
    UserError : (almost) nothing passes the lens.
    """
    tracer = _tracer(backend, problem, lens, (129, 129))
    _, landing = tracer.trace(lens.rear.sag.to_bspline().coefficients)
    budget = tracer.budget(landing, problem.target.half_width)
    if budget.transmitted < 1e-3 * problem.source.flux:
        raise UserError(
            f"only {budget.transmitted:.3g} W of {problem.source.flux:.3g} W pass the unoptimised lens "
            f"(totally reflected {budget.total_internal:.3g} W, past the rear surface {budget.missed_rear:.3g} W); "
            "change the lens prescription"
        )
    return budget.transmitted


def design(
    problem: Problem,
    light: NDArray[np.float64],
    backend: Backend,
    state: State | None = None,
    progress: Callable[[Stage, Row], None] | None = None,
    checkpoint: Callable[[State], None] | None = None,
    note: Callable[[str], None] | None = None,
) -> tuple[Lens, State]:
    """Optimise the rear surface of a problem's lens and return (Lens, State).

    light : the target picture as linear light.  state : to go on from, or None.
    progress : called with (Stage, Row) after every evaluation.
    checkpoint : called with the State after every level.
    note : called with a sentence where the problem itself limits the result.

    Raises
    ------
    Interrupted : on Ctrl-C.  NumericalError : the loss is not finite, or the surfaces cross.
    """
    lens = base_lens(problem)
    flux = transmitted_flux(backend, problem, lens)
    clock = perf_counter() - (state.seconds if state else 0.0)
    state = state or first_state(problem, lens)
    plan = stages(problem)
    on_its_way = state.begun and state.level == plan[-1].level  # such a surface needs neither a start nor coarse pixels
    remaining = plan[-1:] if on_its_way else [stage for stage in plan if stage.level >= state.level]
    start = TransportStart(problem, lens, light) if remaining and not on_its_way and uses_transport(problem) else None
    for stage in remaining:
        if start and not state.begun:
            state = State(stage.level, start.fit(state.sag.space), history=state.history)
        target = target_irradiance(light, stage.screen, problem.target.fit, flux)
        lens = _with_sag(lens, state.sag)
        objective = _objective(backend, problem, lens, stage, target)
        variables = BoundedVariables(state.sag, problem.lens.rear.freeform.z_freedom)
        recorder = _Recorder(objective, variables, stage, state, clock, progress)
        sag = _minimize(recorder, problem, stage)
        marked = _marked(problem, objective, sag, lens.rear.half_width, stage)
        again = not stage.final and stage.level == plan[-1].level
        state = State(stage.level if again else stage.level + 1, sag.refine(marked), again, state.history)
        if checkpoint:
            checkpoint(state)
    if note and start and start.note:
        note(start.note)
    return _with_sag(lens, state.sag), state


def sag_window(problem: Problem, final: bool) -> PixelWindow | BSplineWindow | GaussianWindow:
    """Return the smooth measurement window of a stage.

    A pixel window sees what moves across its border only: before the final stage a B-spline takes its place.
    """
    o = problem.optimizer
    if o.window == "gaussian":
        return GaussianWindow(o.sigma)
    return PixelWindow(o.blur) if o.window == "pixel" and final else BSplineWindow(o.window_degree)


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
        self.state = state
        self.best = np.inf, state.sag.coefficients

    @property
    def best_sag(self) -> THBSurface:
        return THBSurface(self.state.sag.space, self.best[1])

    def __call__(self, weights: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        coefficients = self.variables.coefficients(weights)
        loss, gradient = self._objective(coefficients)
        if not (np.isfinite(loss) and np.isfinite(gradient).all()):
            raise NumericalError(f"the loss is not finite at level {self._stage.level}; lower z_freedom or check the prescription")
        if loss < self.best[0]:
            self.best = loss, coefficients
        history = self.state.history
        row = Row(self._stage.level, len(coefficients), len(history) + 1, loss, self._objective.fit, perf_counter() - self._clock)
        history.append(row)
        if self._progress:
            self._progress(self._stage, row)
        return loss, self.variables.gradient(gradient)


def _minimize(recorder: _Recorder, problem: Problem, stage: Stage) -> THBSurface:
    """Return the best THB surface that L-BFGS finds."""
    options = {"maxiter": stage.iterations, "maxcor": problem.optimizer.memory, "maxfun": 2 * stage.iterations + 10}
    try:
        if stage.iterations == 0:
            recorder(recorder.variables.zeros())
            return recorder.best_sag
        minimize(recorder, recorder.variables.zeros(), jac=True, method="L-BFGS-B", options=options)
    except KeyboardInterrupt:
        raise Interrupted(State(stage.level, recorder.best_sag, True, recorder.state.history)) from None
    return recorder.best_sag


def _objective(backend: Backend, problem: Problem, lens: Lens, stage: Stage, target: NDArray[np.float64]) -> Objective:
    tracer = _tracer(backend, problem, lens, stage.rays)
    weight = problem.optimizer.lost_flux_weight
    embedding = lens.rear.sag.space.embedding
    return Objective(backend, tracer, embedding, stage.screen, sag_window(problem, stage.final), target, weight)


def _tracer(backend: Backend, problem: Problem, lens: Lens, rays: tuple[int, int]) -> Tracer:
    beam = problem_beam(problem, rays)
    embedding = lens.rear.sag.space.embedding
    return Tracer(backend, lens, beam, problem.target_z, (embedding.kv_u, embedding.kv_v))


def _marked(
    problem: Problem, objective: Objective, sag: THBSurface, half_width: tuple[float, float], stage: Stage
) -> dict[int, NDArray[np.int64]]:
    """Return the cells to refine after a level ({} after the last)."""
    freeform = problem.lens.rear.freeform
    if stage.level == freeform.max_level:
        return {}
    knots = vertex_knots(half_width, [_vertices(n, s) for n, s in zip(stage.rays, freeform.spans)])
    indicator = cell_indicator(sag.space, knots, objective.vertex_gradients(sag.coefficients, knots))
    return mark(sag.space, indicator, per_level(problem.refinement.alpha, stage.level), stage.level + 1)


def _vertices(rays: int, spans: int) -> int:
    """Return a vertex count near `rays` whose vertices lie on no knot line (mirror symmetry stays)."""
    steps = rays
    while gcd(steps, 2 * spans) > 1:
        steps += 1
    return steps + 1


def _with_sag(lens: Lens, sag: THBSurface) -> Lens:
    try:
        return lens.with_rear(lens.rear.with_sag(sag))
    except ValueError as error:
        raise NumericalError(f"the optimised lens cannot exist: {error}; lower lens.rear.freeform.z_freedom") from None
