"""The design loop: optimise a level, mark, refine, go on.

Level by level the surface gets more degrees of freedom, and the measurement finer pixels and
more rays.  A level can start from two surfaces:

- flat: the first level starts from the base conic, every other from the exact surface of the
  one before (prolongation);
- transport: every level starts from the optimal-transport surface fitted in the space of the level.  The
  levels before the last then need no optimisation, only the marking of cells.  Where z_freedom cuts off much
  of that surface, the first level starts from what is left of it, or flat where that is better, and every
  other from the one before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from optics.base.runtime import NumericalError, UserError
from optics.designing.optimisation.level_objective import (
    Indicators,
    background,
    marked_cells,
    stage_objective,
)
from optics.designing.optimisation.limit_keeper import LimitKeeper
from optics.designing.optimisation.recorder import Interrupted, Recorder
from optics.designing.optimisation.stage_plan import stages
from optics.designing.optimisation.state import Row, State, first_sags
from optics.designing.optimisation.symmetry import symmetry_axes
from optics.designing.optimisation.transport_start import TransportFit, TransportStart
from optics.light.tracing import Tracer
from optics.scene.problem import Limits, limit_sentences
from thbcad.lens import manufacturability, require_sound
from thbcad.surfaces import THBSurface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from optics.base.runtime import Backend
    from optics.designing.optimisation.stage_plan import Stage
    from optics.light.engines import Engine
    from optics.scene.system import OpticalSystem
    from thbcad.lens import Lens

FALLING = 2e-3  # fall of the misfit per step from which more iterations are worth a note
StageProgress = Callable[["Sequence[Stage]", "Stage", int, "Row | None"], None]
FRESH = 1  # what makes the draw of fresh rays another than that of the measurement
LEAST_FRACTION = 1e-3  # of a level's changes; below it they are not worth keeping


def transmitted_flux(system: OpticalSystem, backend: Backend, lens: Lens | None = None) -> float:
    """Return the flux that a lens sends on, W: the unoptimised one where none is given.

    Raises
    ------
    UserError : (almost) nothing passes the lens.
    """
    which = "unoptimised lens" if lens is None else "lens"
    lens, target, source = lens or system.lens, system.target, system.problem.source
    optimizer, rays = system.problem.optimizer, system.source.rays((129, 129))
    path = system.path(lens)
    tracer = Tracer(backend, path if optimizer.fresnel else path.without_reflection(), rays)
    _, landing = tracer.trace()
    fates = tracer.fates(landing, target.settings.half_width)
    if fates.transmitted < 1e-3 * source.flux:
        raise UserError(
            f"only {fates.transmitted:.3g} {source.unit} of {source.flux:.3g} {source.unit} pass the {which} "
            f"(totally reflected {fates.total_internal:.3g}, past the rear surface {fates.missed_rear:.3g}, "
            f"absorbed {fates.absorbed:.3g}); change the lens prescription"
        )
    return fates.transmitted


def design(
    system: OpticalSystem,
    backend: Backend,
    engine: Engine,
    state: State | None = None,
    progress: StageProgress | None = None,
    checkpoint: Callable[[State], None] | None = None,
    note: Callable[[str], None] | None = None,
    start: TransportStart | None = None,
    seen: Callable[[Stage, Lens, NDArray[np.float64]], None] | None = None,
) -> tuple[Lens, State]:
    """Optimise the free surfaces of a system's lens and return (Lens, State).

    backend : of the exact tracer.  engine : what traces the light that is optimised.
    state : to go on from, or None.
    progress : called with (every Stage, this Stage, its degrees of freedom, None) when a stage begins, and
        with its Row in place of None after every evaluation.
    checkpoint : called with the State after every stage.
    note : called with a sentence where the problem itself limits the result.
    start : of the system, where it is known already.
    seen : called with (Stage, its lens, the target irradiance that it asked for) behind every stage.

    Raises
    ------
    Interrupted : on Ctrl-C.  NumericalError : the loss is not finite, or a level starts from a crossing.
    """
    clock = perf_counter() - (state.seconds if state else 0.0)
    flux = transmitted_flux(system, backend)
    note = _no_note if note is None else note
    axes = symmetry_axes(system)
    start = _transport_start(system, backend, state, note, start)
    state, fit = (state, None) if state else _first_state(system, start, flux, engine)
    guide = start if state.moved else None
    plan, crossing = stages(system, state.moved), 0.0
    for stage in plan[state.stage :]:
        if progress:
            progress(plan, stage, state.dof, None)
        lens = _with_sags(system.lens, state.sags)
        around = background(system, backend, lens, stage, axes) if stage.iterations else None
        target = _asked(system, backend, lens, stage, flux, around)
        if stage.iterations:
            of_stage = partial(stage_objective, stage=stage, target=target, engine=engine, background=around)
            objective = of_stage(system, lens, axes=axes)
            report = progress and partial(progress, plan, stage, state.dof)
            recorder = Recorder(system, objective, stage, state, axes, clock, report)
            keeper = LimitKeeper(system, lens, note) if stage is plan[-1] else None
            begun, (lens, crossed) = lens, _optimised(lens, recorder, stage, note, keeper)
            crossing = max(crossing, crossed)
            if system.source.extended:
                fresh = np.random.default_rng((system.problem.run.seed, FRESH))
                recorder.measure_afresh(of_stage(system, begun, axes=axes, fresh=fresh))
            if stage is plan[-1] and recorder.fall > FALLING:
                note(
                    f"stopped by its {stage.iterations} iterations, while the misfit still fell by "
                    f"{recorder.fall:.1%} a step; --resume --iterations {4 * stage.iterations} goes on"
                )
            state = replace(state, sags=lens.sags, history=recorder.history)
        if seen:
            seen(stage, lens, target)
        try:
            marked = marked_cells(
                system, lens, stage, axes, Indicators(system, engine, target, guide, around)
            )
            following, new_fit = _refined(state, plan, marked, guide)
        except KeyboardInterrupt:
            raise Interrupted(state) from None
        state, fit = following, new_fit or fit
        if checkpoint:
            checkpoint(state)
    if start and fit and not start.within(fit):
        note(start.note(fit))
    lens = _with_sags(system.lens, state.sags)
    problem = system.problem
    if crossing or problem.limits != Limits():
        made = manufacturability(lens, problem.lens.density or None)
        for sentence in limit_sentences(problem, made, crossing):
            note(sentence)
    return lens, state


def _asked(
    system: OpticalSystem,
    backend: Backend,
    lens: Lens,
    stage: Stage,
    flux: float,
    around: NDArray[np.float64] | None,
) -> NDArray[np.float64]:
    """Return the target irradiance that a stage asks for.

    Of sharp light that will be blurred, that is the aim.  Its flux is what the unoptimised lens sends on, W,
    but in the finish: there it is what the present lens sends on, since asking for light that cannot arrive
    spoils what does.  The background's flux is added.
    """
    if stage.finish:
        flux = transmitted_flux(system, backend, lens)
    if around is not None:
        flux += float(around.sum()) * stage.screen.pixel_area
    return (system.goal if stage.aimed else system.target).irradiance(stage.screen, flux)


def _first_state(
    system: OpticalSystem, start: TransportStart | None, flux: float, engine: Engine
) -> tuple[State, TransportFit | None]:
    """Return the state of a new run, and the fit of the transport map, if any.

    flux : that the unoptimised lens sends on, W.
    """
    flat = State(False, 0, first_sags(system, False))
    if start is None:
        return flat, None
    moved, fit = _fitted(State(True, 0, first_sags(system, True)), start)
    if start.follows(fit):
        return moved, fit
    cut, _ = _fitted(flat, start)
    stage = stages(system, False)[0]
    target = system.target.irradiance(stage.screen, flux)

    def loss(state: State) -> float:
        objective = stage_objective(system, _with_sags(system.lens, state.sags), stage, target, engine)
        return objective([sag.coefficients for sag in state.sags]).loss

    return min(cut, flat, key=loss), fit


def _no_note(sentence: str) -> None:
    """Drop the sentence."""


def _transport_start(
    system: OpticalSystem,
    backend: Backend,
    state: State | None,
    note: Callable[[str], None],
    start: TransportStart | None,
) -> TransportStart | None:
    """Return the start by optimal transport, or None where the run needs none.

    It needs none where the problem asks for a flat start, where the map asks for too much sag, and where
    the state to go on from has no level before it.
    """
    if system.problem.optimizer.start == "flat":
        return None
    if state is not None:
        plan = stages(system, state.moved)
        if not state.moved or state.stage >= len(plan) or plan[state.stage].level == plan[-1].level:
            return None
    start = start or TransportStart(system, backend)
    if start.traced is None or start.within(start.traced):
        return start
    note(start.note(start.traced) + "; the design starts from the base surface instead")
    return None


def _fitted(state: State, start: TransportStart) -> tuple[State, TransportFit]:
    """Return the state with the sag of the transport map on the mesh that it shapes, and the fit."""
    fit = start.fit(state.sags[-1].space)
    return replace(state, sags=(*state.sags[:-1], fit.sag)), fit


def _refined(
    state: State,
    plan: Sequence[Stage],
    marked: Sequence[Mapping[int, NDArray[np.int64]]],
    start: TransportStart | None,
) -> tuple[State, TransportFit | None]:
    """Return the state of the next stage, with the marked cells refined, and the fit of a new level."""
    sags = tuple(sag.refine(cells) for sag, cells in zip(state.sags, marked))
    following = replace(state, stage=state.stage + 1, sags=sags)
    if start and following.stage < len(plan) and plan[following.stage].level > plan[state.stage].level:
        return _fitted(following, start)
    return following, None


def _optimised(
    lens: Lens,
    recorder: Recorder,
    stage: Stage,
    note: Callable[[str], None],
    keeper: LimitKeeper | None = None,
) -> tuple[Lens, float]:
    """Return the lens with the sags that the optimiser finds, or the nearest one that can exist, and by how
    much, mm, the surfaces crossed that were found.

    keeper : of the limits, where the lens must end within them.
    """
    try:
        sags = keeper.minimized(recorder, stage.iterations) if keeper else recorder.minimized()
        found, (lens, wrong) = lens.with_sags(sags), nearest_lens(lens, sags)
    except Interrupted as stop:
        sags = nearest_lens(lens, stop.state.sags)[0].sags
        raise Interrupted(replace(stop.state, sags=sags)) from None
    if wrong:
        note(f"level {stage.level}: {wrong}")
    return lens, max(0.0, -found.least_thickness().lower) if wrong else 0.0


def nearest_lens(lens: Lens, sags: Sequence[THBSurface]) -> tuple[Lens, str]:
    """Return the lens with other sags and "".

    Where it cannot exist: the lens with the sags c + t (c' - c) from its present c towards the others c', and
    a sentence that says why, without a remedy.  The step t is halved until a lens can exist.
    """
    try:
        return require_sound(lens.with_sags(sags)), ""
    except ValueError as error:
        wrong = str(error).partition("; ")[0]
    fraction = 1.0
    while fraction > LEAST_FRACTION:
        fraction /= 2
        between = [
            THBSurface(a.space, a.coefficients + fraction * (b.coefficients - a.coefficients))
            for a, b in zip(lens.sags, sags)
        ]
        try:
            return (
                require_sound(lens.with_sags(between)),
                f"the optimised lens cannot exist ({wrong}): of the level's changes {fraction:.2g} are kept",
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
