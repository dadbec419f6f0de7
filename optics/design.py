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
from dataclasses import dataclass, field
from functools import partial
from math import ceil, gcd
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from optics.errors import NumericalError, UserError
from optics.model import base_lens, freeforms, problem_rays, source_profile, target_irradiance, target_screen
from optics.objective import Objective
from optics.problem import Problem, per_level
from optics.refinement import mark, promised_decrease, refined_once, summed_over_cells, vertex_knots
from optics.shape import ShapePenalty, ShapeWeights
from optics.start import TransportStart
from optics.symmetry import Mirrors, mirror_axes
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
PROBES = 8  # evaluations that estimate the diagonal of the Gauss-Newton Hessian
LIMITS_WEIGHT = 100.0  # charge for the mean square of relative violations
SOFT_RIM = 0.02  # of the half-width: where rays count less and less
PIXELS_PER_SPAN = 4  # a level's pixels are merged while this many remain per knot span


@dataclass(frozen=True)
class Row:
    """One evaluation in the history; those that only estimate curvature are counted but have no row."""

    level: int
    dof: int
    evaluation: int
    loss: float
    fit: float
    seconds: float


@dataclass
class State:
    """What a run needs to go on: the next level to optimise and the sags it starts from, front first.

    begun : the level was interrupted, `sags` are its best so far.
    """

    level: int
    sags: tuple[THBSurface, ...]
    begun: bool = False
    history: list[Row] = field(default_factory=list)

    @property
    def evaluations(self) -> int:
        return self.history[-1].evaluation if self.history else 0

    @property
    def seconds(self) -> float:
        return self.history[-1].seconds if self.history else 0.0


class Interrupted(Exception):
    """The run was stopped by the user; `state` holds the best surfaces of the level so far."""

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


def first_level(problem: Problem, moved: bool) -> int:
    """Return the level at which optimisation starts.

    A transport start makes the levels superfluous whose spans are wider than four pixels.
    """
    last = last_level(problem)
    if not moved:
        return 0
    fine = [level for level in range(last + 1) if _coarsening(problem, level) == problem.optimizer.merge]
    return fine[0] if fine else last


def last_level(problem: Problem) -> int:
    """Return the level at which the run ends."""
    return max(f.max_level for f in freeforms(problem))


def stages(problem: Problem, moved: bool) -> list[Stage]:
    """Return the Stage of every level that is optimised; moved : the design starts from an optimal-transport map."""
    out = []
    last = last_level(problem)
    for level in range(first_level(problem, moved), last + 1):
        iterations = 0 if moved and level < last else per_level(problem.optimizer.iterations, level)
        if moved and level == last and iterations > 1 and min(problem.target.pixels) >= COARSER * COARSE_PIXELS:
            coarser = COARSER * problem.optimizer.merge
            out.append(_stage(problem, level, min(COARSE_ITERATIONS, iterations), coarser, False))
        out.append(_stage(problem, level, iterations, _coarsening(problem, level), level == last))
    return out


def _stage(problem: Problem, level: int, iterations: int, coarsening: int, final: bool) -> Stage:
    screen = target_screen(problem, coarsening, MARGIN)
    spans = _spans(problem, level)
    rays = tuple(max(64, ceil(problem.optimizer.rays_per_pixel * n), 2 * s) + 1 for n, s in zip(screen.pixels, spans))
    if rays[0] * rays[1] > MOST_RAYS:
        raise UserError(
            f"level {level} would trace {rays[0]} x {rays[1]} rays at once, too many for the memory of most machines; "
            "use fewer target.pixels, lens.rear.freeform.spans or levels, or fewer optimizer.rays_per_pixel"
        )
    return Stage(level, iterations, screen, rays, final)


def _spans(problem: Problem, level: int) -> list[int]:
    """Return the knot spans in x and y of the finest free surface on a level."""
    return [
        max(n << min(level, f.max_level) for n, f in zip(row, freeforms(problem))) for row in zip(*(f.spans for f in freeforms(problem)))
    ]


def _coarsening(problem: Problem, level: int) -> int:
    """Return how many pixels a level merges in each direction: optimizer.merge times a power of 2."""
    spans = _spans(problem, level)
    coarsening = problem.optimizer.merge
    while all(n // (2 * coarsening) >= PIXELS_PER_SPAN * s for n, s in zip(problem.target.pixels, spans)):
        coarsening *= 2
    return coarsening


def first_state(problem: Problem, lens: Lens, moved: bool) -> State:
    """Return the State from which a new run starts: the first level's meshes, sags zero."""
    sags = []
    for sag, freeform in zip(lens.sags, freeforms(problem)):
        for level in range(min(first_level(problem, moved), freeform.max_level)):
            sag = sag.refine({level: sag.space.cells[:, 1:]})
        sags.append(sag)
    return State(first_level(problem, moved), tuple(sags))


def earlier_state(problem: Problem, lens: Lens, earlier: Lens) -> State:
    """Return the State that optimises the sags of an earlier design on the last level, on their own meshes.

    A surface that was not free in the earlier design starts from zero.

    Raises
    ------
    UserError : the rear has no sag, or a sag lies over another rectangle, conic or mesh.
    """
    if earlier.rear.sag is None:
        raise UserError("the earlier design has no freeform rear surface to start from")
    sags = []
    for name in ("front", "rear"):
        own, other = getattr(lens, name), getattr(earlier, name)
        if own.sag is not None:
            sags.append(own.sag if other.sag is None else other.sag)
        same = own.half_width == other.half_width and own.conic == other.conic
        if own.sag is not None and other.sag is not None:
            same = same and all(
                a.degree == b.degree and np.array_equal(a.knots, b.knots)
                for a, b in zip((own.sag.space.kv_u, own.sag.space.kv_v), (other.sag.space.kv_u, other.sag.space.kv_v))
            )
        if not same or (own.sag is None and other.sag is not None):
            raise UserError(
                f"the {name} surface of the earlier design differs in half_width, radius, conic, degree or spans; "
                f"make lens.{name} equal to its problem.toml"
            )
    return State(last_level(problem), tuple(sags), begun=True)


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
            f"(totally reflected {budget.total_internal:.3g} W, past the rear surface {budget.missed_rear:.3g} W); "
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
    Interrupted : on Ctrl-C.  NumericalError : the loss is not finite, or the surfaces cross.
    """
    lens = base_lens(problem)
    flux = transmitted_flux(backend, problem, lens)
    clock = perf_counter() - (state.seconds if state else 0.0)
    target = target_irradiance(light, target_screen(problem), problem.target.placing, 1.0)
    axes = mirror_axes(target, source_profile(problem))
    on_its_way = state is not None and state.begun and state.level == last_level(problem)  # needs neither a start nor coarse pixels
    start = None if on_its_way else _transport_start(problem, lens, light, backend, note)
    plan = stages(problem, start is not None)
    state = state or first_state(problem, lens, start is not None)
    remaining = plan[-1:] if on_its_way else [stage for stage in plan if stage.level >= state.level]
    for stage in remaining:
        if start and not state.begun:
            state = State(stage.level, (*state.sags[:-1], start.fit(state.sags[-1].space)), history=state.history)
        target = target_irradiance(light, stage.screen, problem.target.placing, flux)
        lens = _with_sags(lens, state.sags)
        objective = _objective(backend, problem, lens, stage, target)
        variables = BoundedVariables(state.sags, [f.z_freedom for f in freeforms(problem)], axes)
        recorder = _Recorder(objective, variables, stage, state, clock, partial(progress, plan) if progress else None)
        again = not stage.final and stage.level == plan[-1].level  # a coarse pass, which is better off without the scale
        lens = _with_sags(lens, _minimize(recorder, problem, stage, not again))
        marked = _marked(problem, lens, stage, axes, _Indicators(problem, backend, target, start))
        sags = tuple(sag.refine(cells) for sag, cells in zip(lens.sags, marked))
        state = State(stage.level if again else stage.level + 1, sags, again, state.history)
        if checkpoint:
            checkpoint(state)
    if note and start and start.note:
        note(start.note)
    return _with_sags(lens, state.sags), state


def _transport_start(
    problem: Problem, lens: Lens, light: NDArray[np.float64], backend: Backend, note: Callable[[str], None] | None
) -> TransportStart | None:
    """Return the start by optimal transport, or None where the problem asks for a flat one or the map asks for too much sag."""
    if problem.optimizer.start == "flat":
        return None
    start = TransportStart(problem, lens, light, backend)
    if start.parallel or start.within:
        return start
    if note:
        note(start.note + "; the design starts from the base surface instead")
    return None


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
            raise NumericalError(f"the loss is not finite at level {self._stage.level}; lower z_freedom or check the prescription")
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
    options = {"maxiter": stage.iterations, "maxcor": problem.optimizer.memory, "maxfun": 2 * stage.iterations + 10, "gtol": 0.0}
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


def _objective(backend: Backend, problem: Problem, lens: Lens, stage: Stage, target: NDArray[np.float64]) -> Objective:
    tracer = Tracer(backend, lens, problem_rays(problem, stage.rays), problem.target_z, SOFT_RIM, sure=False)
    options, limits = problem.optimizer, problem.limits
    weights = ShapeWeights(options.roughness_weight, LIMITS_WEIGHT, limits.radius, limits.thickness)
    shape = ShapePenalty(lens, weights) if weights.any else None
    window = sag_window(problem, stage.final)
    return Objective(backend, tracer, stage.screen, window, target, options.lost_flux_weight, options.dark_flux_weight, shape)


def _marked(problem: Problem, lens: Lens, stage: Stage, axes: Sequence[int], indicators: _Indicators) -> list[dict[int, NDArray[np.int64]]]:
    """Return the cells of every free surface to refine after a level ({} after the last)."""
    settings = freeforms(problem)
    if stage.level == last_level(problem):
        return [{}] * len(settings)
    alpha, out = per_level(problem.refinement.alpha, stage.level), []
    for sag, freeform, indicator in zip(lens.sags, settings, indicators(lens, stage)):
        indicator = Mirrors(sag.space, axes).of_cells(indicator)
        out.append(mark(sag.space, indicator, alpha, min(stage.level + 1, freeform.max_level)))
    return out


@dataclass(frozen=True, eq=False)
class _Indicators:
    """The refinement indicators of a design, called with (Lens, Stage): numbers per leaf cell of every free surface.

    Only the rear has slopes to compare with, after a transport start: "slope" takes vertex gradients for the rest.
    """

    problem: Problem
    backend: Backend
    target: NDArray[np.float64]
    start: TransportStart | None

    def __call__(self, lens: Lens, stage: Stage) -> list[NDArray[np.float64]]:
        if self.problem.refinement.indicator == "decrease":
            return self._decrease(lens, stage)
        found = self._vertex(lens, stage)
        if self.problem.refinement.indicator == "slope" and self.start:
            found[-1] = self.start.misfit(lens.rear.sag)
        return found

    def _vertex(self, lens: Lens, stage: Stage) -> list[NDArray[np.float64]]:
        rectangles = [s.half_width for s in (lens.front, lens.rear) if s.sag is not None]
        spans = [f.spans for f in freeforms(self.problem)]
        knots = [vertex_knots(h, [_vertices(n, s) for n, s in zip(stage.rays, row)]) for h, row in zip(rectangles, spans)]
        objective = _objective(self.backend, self.problem, lens, stage, self.target)
        gradients = objective.vertex_gradients([sag.coefficients for sag in lens.sags], knots)
        return [
            summed_over_cells(sag.space, *(k.greville() for k in kv), gradient) for sag, kv, gradient in zip(lens.sags, knots, gradients)
        ]

    def _decrease(self, lens: Lens, stage: Stage) -> list[NDArray[np.float64]]:
        spaces = [refined_once(sag.space, f.max_level) for sag, f in zip(lens.sags, freeforms(self.problem))]
        finer = [THBSurface(space, sag.space.prolongation(space) @ sag.coefficients) for sag, space in zip(lens.sags, spaces)]
        objective = _objective(self.backend, self.problem, _with_sags(lens, finer), stage, self.target)
        coefficients = [sag.coefficients for sag in finer]
        _, gradients = objective(coefficients)
        probes = zip(*objective.curvature(coefficients, PROBES, self.problem.run.seed))
        return [promised_decrease(sag.space, space, g, p) for sag, space, g, p in zip(lens.sags, spaces, gradients, probes)]


def _vertices(rays: int, spans: int) -> int:
    """Return a vertex count near `rays` whose vertices lie on no knot line (mirror symmetry stays)."""
    steps = rays
    while gcd(steps, 2 * spans) > 1:
        steps += 1
    return steps + 1


def _with_sags(lens: Lens, sags: Sequence[THBSurface]) -> Lens:
    try:
        return lens.with_sags(sags)
    except ValueError as error:
        raise NumericalError(f"the optimised lens cannot exist: {error}; lower z_freedom of the free surfaces") from None
