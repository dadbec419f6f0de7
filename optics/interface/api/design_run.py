"""The whole design of a lens, from a problem to what is known of the result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from optics.base.runtime import ProgressEvent, UserError, device
from optics.designing.optimisation import ROUNDS, Interrupted, Listener, State, re_aimed, shape_lens, stages
from optics.designing.progress import DesignProgress, Notes, RunClock, Size
from optics.interface.api.design_result import Design
from optics.interface.api.level_records import LevelKeeper
from optics.interface.api.prepared_problem import Prepared, prepared, shaping_by
from optics.light.engines import Engine
from optics.scene.problem import Problem
from optics.scene.receivers import Receiver
from optics.scene.sources import LightSource
from optics.scene.system import Own, advice, solvable_system

Show = Callable[[ProgressEvent], None]


def design(
    problem: Problem,
    progress: bool | Show | None = None,
    engine: str | Engine | None = None,
    source: LightSource | None = None,
    receiver: Receiver | None = None,
) -> Design:
    """Shape the lens of a problem and return the Design.

    progress : True draws a bar in terminals and notebooks; a function is called with every
        `optics.base.runtime.ProgressEvent`.
    engine : a name as of `optimizer.engine`, an `optics.light.engines.Engine`, or None for the problem's own.
    source, receiver : as of `System`.

    Ctrl-C ends the work.  The design then holds the best lens so far, and `interrupted` is true; where no
    level had begun, the KeyboardInterrupt goes on.

    Raises UserError : a problem that cannot be solved; one sentence says why.
    Raises NumericalError : the loss is not finite, or the surfaces cross.
    """
    if not isinstance(problem, Problem):
        raise UserError(f"design takes a Problem, got {problem!r}; optics.load_problem reads a file")
    clock, notes = RunClock(_progress(progress)), Notes()
    with clock.progress, device():
        system = solvable_system(problem, Own(source, receiver))
        clock.progress.asked(system)
        made = designed(problem, prepared(system), clock, notes, engine)
    if made.interrupted:
        notes("stopped by Ctrl-C: this is the best lens so far")
    return made


def designed(
    asked: Problem,
    ready: Prepared,
    clock: RunClock,
    notes: Notes,
    engine: str | Engine | None = None,
    state: State | None = None,
    keep: Callable[[State], object] = lambda state: None,
    watching: Callable[[Listener, Engine], Listener] | None = None,
) -> Design:
    """Optimise the lens of a prepared problem and return the Design, of which nothing is measured yet.

    Ctrl-C ends the work with the best lens so far, where a level had begun.

    asked : the problem as it was read.  state : to go on from.
    keep : called with the State after every level, and with that of an interrupted one.
    watching : returns the Listener to be told in place of one, and takes the engine; see `LiveView`.
    """
    system, backend = ready.system, ready.backend
    for sentence in advice(system):
        notes(sentence)
    single = backend.with_precision("single") if system.problem.run.precision == "mixed" else None
    traced, chosen = shaping_by(engine, system, backend, of_drawn=single)
    mapped = state.started_from_transport if state else system.problem.optimizer.start == "transport"
    clock.progress.planned(Size.of(system), stages(traced, mapped))
    clock.lap("setup")
    levels = LevelKeeper(system, traced, chosen)
    listener = Listener(clock.progress, keep, notes)
    if system.problem.run.keep == "levels":
        listener = replace(listener, seen=levels)
    if watching:
        listener = watching(listener, chosen)
    try:
        _, state = shape_lens(traced, backend, chosen, state, ready.start, listener)
        for _ in range(ROUNDS):
            try:
                again = re_aimed(system, traced, state, chosen)
            except KeyboardInterrupt:
                raise Interrupted(state) from None
            if again is None:
                break
            traced, state = again
            # notes are of the first round
            listener = replace(listener, note=Listener.note)
            _, state = shape_lens(traced, backend, chosen, state, listener=listener)
    except Interrupted as stop:
        keep(stop.state)
        state, interrupted = stop.state, True
    else:
        interrupted = False
    backend.release()
    clock.lap("optimise")
    system, unfit = system.with_sags(state.sags).as_possible()
    if unfit:
        notes(unfit)
    return Design(
        system,
        state.history,
        notes,
        requested=asked,
        wall_s=clock.total(),
        started_from_transport=state.started_from_transport,
        interrupted=interrupted,
        levels=tuple(levels.records),
    )


def _progress(progress: bool | Show | None) -> DesignProgress:
    if progress is True:
        return DesignProgress()
    if progress is None or progress is False:
        return DesignProgress(lambda event: None)
    if not callable(progress):
        raise UserError(f"progress must be True, None or a function of a ProgressEvent, got {progress!r}")
    return DesignProgress(progress)
