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

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter

from optics.base.runtime import Backend, UserError
from optics.designing.optimisation.bounded_variables import BoundedVariables
from optics.designing.optimisation.first_state import (
    first_state,
    sound_with,
    transport_start,
    with_sags,
)
from optics.designing.optimisation.level_objective import (
    Background,
    Indicators,
    background,
    marked_cells,
    stage_film,
    stage_objective,
)
from optics.designing.optimisation.limit_keeper import LimitKeeper
from optics.designing.optimisation.stage_plan import PROBES, Stage, stages
from optics.designing.optimisation.stage_search import Interrupted, Log, Search, minimised
from optics.designing.optimisation.state import Row, State
from optics.designing.penalties import limited_metrics
from optics.designing.starts import TransportFit, TransportStart
from optics.light.analysis import loss_notes
from optics.light.engines import Engine
from optics.light.measuring import symmetry_axes
from optics.light.tracing import Tracer
from optics.scene.limits import limit_sentences
from optics.scene.problem import Limits
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.surfaces import THBSurface

FALLING = 2e-3  # fall of the misfit per step from which more iterations are worth a note
FRESH = 1  # what makes the draw of fresh rays another than that of the measurement
LOST = 0.02  # of the flux asked for, by the surface of a map: less is within what its steps repair
LEAST_FRACTION = 1e-3  # of a level's changes; below it they are not worth keeping


def _ignored(*_: object) -> None:
    """Do nothing with what is told."""


def transmitted_flux(system: System, backend: Backend) -> float:
    """Return the flux that the lens of a system sends on, W.

    Raises UserError : (almost) nothing passes the lens.
    """
    optic, units = system.problem.optic, system.units
    which = f"unoptimised {optic.noun}" if system.designed is system.base else optic.noun
    target, flux = system.target, system.problem.flux
    optimizer, rays = system.problem.optimizer, system.source.rays((129, 129))
    path = system.path
    path = path if optimizer.fresnel else path.without_reflection()
    tracer = Tracer(backend, path, rays, polarised=False)  # as the light that is optimised
    _, landing = tracer.trace()
    fates = tracer.fates(landing, target.settings.half_width)
    if fates.transmitted < 1e-3 * flux:
        worst, faces = max(fates.flux, key=lambda fate: float(fates.flux[fate])), system.problem.faces_met
        table = faces[worst.number].optic.table
        raise UserError(
            f"only {fates.transmitted:.3g} {units.flux} of {flux:.3g} {units.flux} pass the {which}: "
            f"{', '.join(loss_notes({units.key('fates'): fates.by_name}, units)) or 'much is reflected'}; "
            + ("change the lens prescription" if system.problem.lens else f"move {table}, or change it")
        )
    return fates.transmitted


@dataclass(frozen=True)
class Listener:
    """Who is told of a run; by default nobody.

    progress : called with (every Stage, this Stage, its degrees of freedom, None) when a stage begins, and
        with its Row in place of None after every evaluation.
    checkpoint : called with the State after every stage.
    note : called with a sentence where the problem itself limits the result.
    seen : called after every stage with (Stage, its system, the target irradiance that it asked for).
    """

    progress: Callable[[Sequence[Stage], Stage, int, Row | None], object] = _ignored
    checkpoint: Callable[[State], object] = _ignored
    note: Callable[[str], object] = _ignored
    seen: Callable[[Stage, System, Floats], object] = _ignored


def shape_lens(
    system: System,
    backend: Backend,
    engine: Engine,
    state: State | None = None,
    start: TransportStart | None = None,
    listener: Listener | None = None,
) -> tuple[System, State]:
    """Optimise the free surfaces of a system, stage by stage, and return it with them, and the State.

    backend : of the exact tracer.  engine : what traces the light that is optimised.
    state : to go on from, or None.  start : of the system, where it is known already.

    Raises Interrupted : on Ctrl-C.  NumericalError : the loss is not finite, or a level starts from a
        crossing.  UserError : the start has no body for a mould as the problem describes it.
    """
    clock = perf_counter() - (state.seconds if state else 0.0)
    listener = listener or Listener()
    flux = transmitted_flux(system.unshaped, backend)
    axes = symmetry_axes(system)
    start = transport_start(system, backend, state, listener.note, start)
    if state is None:
        state, fit = first_state(system, start, flux, engine)
        # a body for a mould that its start cannot have is refused before the work
        _ = with_sags(system, state.sags).made
    else:
        fit = None
    run = _Run(
        system,
        backend,
        engine,
        flux,
        axes,
        start if state.started_from_transport else None,
        start,
        clock,
        stages(system, state.started_from_transport),
    )
    crossings: dict[str, float] = {}
    for stage in run.plan[state.stage :]:
        try:
            listener.progress(run.plan, stage, state.dof, None)
            task = run.task(stage, state)
            shaped = task.system
            if stage.iterations:
                shaped, state, crossed = run.optimised(task, state, listener)
                crossings |= {name: max(by, crossings.get(name, 0.0)) for name, by in crossed.items()}
            listener.seen(stage, shaped, task.target)
            state, new_fit = run.refined(task, shaped, state)
            fit = new_fit or fit
            listener.checkpoint(state)
        except KeyboardInterrupt:
            raise Interrupted(state) from None
    if start and fit and not start.within(fit):
        listener.note(start.note(fit, start.finest_fit()))
    shaped = with_sags(system, state.sags)
    if crossings or system.problem.limits != Limits():
        for optic, shape in shaped.free_elements:
            made = limited_metrics(optic, shape, system.problem.limits)
            name, crossing = optic.called, crossings.get(optic.called, 0.0)
            of = "" if optic is system.problem.optic else name
            for sentence in limit_sentences(system.problem.about(optic), made, crossing, of):
                listener.note(sentence)
    return shaped, state


@dataclass(frozen=True, eq=False)
class _Task:
    """What a stage is to do.

    system : that it starts from.  target : irradiance asked for.  background : light of other ways.
    """

    stage: Stage
    system: System
    target: Floats
    background: Background | None


@dataclass(frozen=True, eq=False)
class _Run:
    """What stays the same through a run.

    flux : that the unoptimised lens sends on, W.  axes : directions of mirror symmetry that is kept.
    guide : the transport map whose surface every level starts from.  known : the map, also where levels do
    not start from it.  clock : `perf_counter()` at the start.
    """

    system: System
    backend: Backend
    engine: Engine
    flux: float
    axes: Sequence[int]
    guide: TransportStart | None
    known: TransportStart | None
    clock: float
    plan: Sequence[Stage]

    def task(self, stage: Stage, state: State) -> _Task:
        """Return the task of a stage.

        Of sharp light that will be blurred, the target is the aim.  Its flux is what the unoptimised lens
        sends on, but in the finish, and where the surface of a map sends on less: there it is what the
        present lens sends on, since asking for light that cannot arrive spoils what does, and by other ways.
        """
        system = with_sags(self.system, state.sags)
        film, fixed = stage_film(system, stage, self.axes), stage.finish
        around = background(system, self.backend, film, fixed) if stage.other_ways else None
        flux = transmitted_flux(system, self.backend)
        mapped = state.started_from_transport and flux < (1 - LOST) * self.flux
        flux = flux if stage.finish or mapped else self.flux
        if around is not None:
            flux += float(around.image.sum()) * stage.screen.pixel_area
        wanted = system.goal if stage.aimed else system.target
        return _Task(stage, system, wanted.irradiance(stage.screen, flux), around)

    def optimised(
        self, task: _Task, state: State, listener: Listener
    ) -> tuple[System, State, dict[str, float]]:
        """Return the system that the optimiser finds, or the nearest that can exist, the state with
        them, and by how much, mm, the surfaces crossed that were found, by the names of their elements.

        The last stage ends within the limits.
        """
        system, stage, last = task.system, task.stage, task.stage is self.plan[-1]
        of_stage = partial(
            stage_objective,
            system,
            target=task.target,
            engine=self.engine,
            axes=self.axes,
        )
        outlines = [surface.outline for surface in system.free_surfaces]
        bounds = [f.freedom for f in system.freeforms]
        variables = BoundedVariables(state.sags, bounds, self.axes, outlines)
        objective = of_stage(stage, background=task.background)
        curvature = (objective if stage.roughly is stage else of_stage(stage.roughly)).curvature(
            variables.coefficients(variables.zeros())[0], PROBES, system.problem.run.seed
        )
        if last:  # more rays than all before need the memory that these had
            self.backend.release()
        search = Search(system.problem, objective, variables, state.sags, curvature)
        log = Log(state, stage, self.clock, partial(listener.progress, self.plan, stage, state.dof))
        log.evaluations += PROBES
        try:
            keeper = LimitKeeper(system, self.guide, listener.note, self.known)
            if last:
                sags, found = keeper.minimised(search, stage.iterations, log)
            else:
                begun = keeper.begun(search, log) if state.started_from_transport else search
                found = minimised(begun, stage.iterations, log)
                sags = found.sags
            shaped, wrong = nearest_shapes(system, sags)
        except Interrupted as stop:
            shaped, _ = nearest_shapes(system, stop.state.sags)
            raise Interrupted(replace(stop.state, sags=shaped.sags)) from None
        crossings: dict[str, float] = {}
        if wrong:
            listener.note(f"level {stage.level}: {wrong}")
            wanted = system.with_sags(sags)
            gaps = {optic.called: s.least_thickness().lower for optic, s in wanted.free_elements}
            crossings = {name: -gap for name, gap in gaps.items() if gap < 0}
        if found and system.source.extended:  # the optimiser fits the noise of its own rays too
            fresh = system.problem.run.seed, FRESH
            others = of_stage(stage, fresh=fresh, background=task.background)
            log.rows[found.row] = replace(log.rows[found.row], fresh_fit=others(found.coefficients).fit)
        if found and last and found.fall > FALLING:
            listener.note(
                f"stopped by its {stage.iterations} iterations, while the misfit still fell by "
                f"{found.fall:.1%} a step; --resume --iterations {4 * stage.iterations} goes on"
            )
        return shaped, log.state(shaped.sags), crossings

    def refined(self, task: _Task, shaped: System, state: State) -> tuple[State, TransportFit | None]:
        """Return the state of the next stage, with the marked cells refined, and the fit of a new level.

        Where none is marked a sag stays the same object, with what is known of its mesh.

        shaped : that the stage ended with.
        """
        indicators = Indicators(self.engine, task.target, self.guide)
        marked = marked_cells(shaped, task.stage, self.axes, indicators)
        fit, further = None, self.plan[state.stage + 1 :]
        *others, (last, cells) = zip(state.sags, marked)
        if self.guide and further and further[0].level > task.stage.level:
            fit = self.guide.fit(last.space.refine(cells))
            last, cells = fit.sag, {}
        sags = tuple(sag.refine(own) if own else sag for sag, own in (*others, (last, cells)))
        return replace(state, stage=state.stage + 1, sags=sags), fit


def nearest_shapes(system: System, sags: Sequence[THBSurface]) -> tuple[System, str]:
    """Return the system with other sags and "".

    Where they cannot exist: with the sags c + t (c' - c) from the present c towards the others c', and
    a sentence that says why, without a remedy.  The step t is halved until all elements can exist.
    """
    try:
        return sound_with(system, sags), ""
    except ValueError as error:
        wrong = str(error).partition("; ")[0]
    fraction = 1.0
    while fraction > LEAST_FRACTION:
        fraction /= 2
        between = [
            THBSurface(a.space, a.coefficients + fraction * (b.coefficients - a.coefficients))
            for a, b in zip(system.sags, sags)
        ]
        try:
            return (
                sound_with(system, between),
                f"the optimised lens cannot exist ({wrong}): of the level's changes {fraction:.2g} are kept",
            )
        except ValueError:
            continue
    return (
        system,
        f"the optimised lens cannot exist ({wrong}): none of the level's changes are kept",
    )
