"""`thbcad design`: from a problem file to the result folder."""

from __future__ import annotations

import os
import shlex
import sys
import webbrowser
from argparse import Namespace
from collections.abc import Sequence
from concurrent.futures import Future
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optics.base.runtime import HelperProcess, ProcessEnded, UserError, check_lines, note
from optics.designing.optimisation import Row, State, earlier_state
from optics.designing.progress import DesignProgress, Notes, RunClock
from optics.exchange.results import (
    LIVE,
    ResultFolder,
    fingerprint,
    read_checkpoint,
    require_room_for_live_page,
    write_checkpoint,
    write_live_page,
)
from optics.interface.commands.outcome import OF_GRADES, Outcome, number_text
from optics.interface.commands.problem_options import changes_of, result_path, system_of
from optics.interface.relighting import given_system
from optics.interface.screens import Heading, design_screen
from optics.light.analysis import (
    WHAT_HELPS,
    counted_ways,
    crosstalk_line,
    error_words,
    photometric_lines,
)
from optics.reporting.live import LiveView
from optics.scene.problem import Problem
from optics.scene.system import System

if TYPE_CHECKING:
    from optics.interface.api import Written


SCREENS = "DISPLAY", "WAYLAND_DISPLAY"  # environment variables: a browser can be shown on it


@dataclass(frozen=True)
class _Run:
    """One design on its way.

    asked : the problem as it was read.  words : of the command line.  history : of what the checkpoint keeps.
    live : the page that shows it, once it has begun.  identity : fingerprint of the problem at the beginning.
    """

    asked: Problem
    words: Sequence[str]
    folder: ResultFolder
    clock: RunClock
    live: LiveView
    notes: Notes = field(default_factory=lambda: Notes(listener=note))
    history: list[Row] = field(default_factory=list)
    identity: str = ""

    def require_same_files(self) -> None:
        """Raise UserError where the picture or rays of the problem are no more those of `identity`."""
        try:
            same = fingerprint(self.asked) == self.identity
        except OSError:
            same = False
        if not same:
            raise UserError(
                "the picture or the rays that the problem names changed while the design ran: put the file "
                "back; with --resume the same command then goes on from the last level that is kept"
            )


def design(options: Namespace) -> Outcome:
    """Shape the lens of a problem file and write the result folder."""
    folder = ResultFolder(result_path(options))
    live = LiveView(partial(write_live_page, folder.path))
    clock = RunClock(DesignProgress(watch=live))
    if options.resume and options.earlier:
        raise UserError("--resume and --from exclude each other: a resumed run has its surface")
    if options.iterations is not None and (not options.resume or options.iterations < 1):
        raise UserError("--iterations takes a number from 1 on, and needs --resume")
    if options.lens and (options.resume or options.earlier or options.live):
        raise UserError("--lens takes a lens as it is: --resume, --from and --live are for designs")
    if options.turn and not options.lens:
        raise UserError("--turn turns the lens of --lens; give one")
    system = asked_system(options)
    problem = system.problem
    run = _Run(problem, options.words, folder, clock, live, identity=fingerprint(problem))
    if not options.force:
        folder.require_kept(Path(options.problem))
    with folder.taken(problem, options.force or (options.resume and folder.checkpoint.exists())):
        if options.live:
            require_room_for_live_page(folder.path, options.force)
        try:
            return _designed(run, system, options)
        except BaseException as error:
            ended = "the run has ended without a result; the terminal says why"
            kept = isinstance(error, ProcessEnded | OSError) and folder.has_run_of(problem)
            if kept or isinstance(error, KeyboardInterrupt):
                ended = _what_is_kept(run, options.lens)
                run.notes(ended)
            live.stop(ended)
            raise


def asked_system(options: Namespace) -> System:
    """Return the system of the problem, with the lens of --lens where that is given."""
    if not options.lens:
        return system_of(options)
    return given_system(options.problem, changes_of(options), options.lens, options.turn)


def _designed(run: _Run, system: System, options: Namespace) -> Outcome:
    # a problem that is refused needs none of it
    from optics.interface.api import (
        Design,
        DesignFigures,
        designed,
        helpers,
        prepared,
        require_engine,
        write_result,
    )

    if not options.lens:
        require_engine(system)
    with run.clock.progress, ExitStack() as stack:
        run.clock.progress.asked(system)
        # before there are threads, which forbid copies
        solids, drawing = stack.enter_context(helpers(forked=True))
        if not (options.resume or options.earlier):  # what these refuse waits for no package
            _load(solids, drawing)
        if options.lens:
            design = Design(system, notes=run.notes, requested=run.asked)
            # it says whose files lie here until the record does
            begun = State(False, 0, tuple(system.designed.sags))
            write_checkpoint(run.folder.checkpoint, run.asked, system.problem, begun)
            written = write_result(design, run.folder, run.clock, solids, DesignFigures(drawing, system))
            return _outcome(written, system)
        ready = prepared(system)
        resolved = ready.system  # a checkpoint belongs to it, also with other --iterations
        state = _resumed(run, resolved) if options.resume else None
        if state is not None and options.iterations:
            optimizer = replace(resolved.problem.optimizer, iterations=(options.iterations,))
            ready = replace(ready, system=System(replace(resolved.problem, optimizer=optimizer)))
            state = state.renumbered(resolved, ready.system).with_steps_left(ready.system)
        if options.earlier:
            earlier = ResultFolder(options.earlier)
            state = earlier_state(ready.system, earlier.read_lens(), earlier.found_shapes())
        if state is not None:
            _load(solids, drawing)
        figures = DesignFigures(drawing, ready.system)

        if options.live:
            run.live.begin(resolved.problem.title, state.history if state else ())
            show_in_browser(run.folder.path / LIVE)

        def keep(state: State) -> None:
            run.require_same_files()
            state = state.renumbered(ready.system, resolved)
            write_checkpoint(run.folder.checkpoint, run.asked, resolved.problem, state, run.notes)
            run.history[:] = state.history

        design = designed(run.asked, ready, run.clock, run.notes, None, state, keep, run.live.watching)
        if design.interrupted:
            raise KeyboardInterrupt
        run.require_same_files()
        written = write_result(design, run.folder, run.clock, solids, figures)
        run.live.done()
    return _outcome(written, system)


def _load(solids: HelperProcess, drawing: HelperProcess) -> None:
    """Let the helper processes load their packages one after the other, while this one has other work."""

    def load_next(_: Future[Any]) -> None:
        with suppress(RuntimeError):  # the process was stopped meanwhile
            drawing.ask("optics.base.runtime", "load", "optics.reporting.figures", "solid_views")

    loaded = solids.ask("optics.base.runtime", "load", "optics.exchange.verification", "export_step")
    loaded.add_done_callback(load_next)


def show_in_browser(page: Path) -> None:
    """Say on stderr where a page lies, and open it where a person sits before a screen.

    Without a screen a browser would take over the terminal.
    """
    note(f"watch it in a browser: {page.resolve().as_uri()}")
    if sys.stderr.isatty() and (sys.platform in ("darwin", "win32") or any(map(os.environ.get, SCREENS))):
        webbrowser.open(page.resolve().as_uri())


def _resumed(run: _Run, system: System) -> State:
    """Return the state of the checkpoint, or that of the finished result of the same problem."""
    if run.folder.checkpoint.exists() or not run.folder.is_result_of(run.asked):
        state, earlier = read_checkpoint(run.folder.checkpoint, system)
        run.notes.extend(earlier)
        return state
    run.notes(f"goes on from the finished result in {run.folder.path}, on its last level")
    result = run.folder.read(taken=True)
    return earlier_state(system, result.lens, result.system.shapes)


def _what_is_kept(run: _Run, lens: str | None) -> str:
    """Return how far a run came that was stopped, and the command line that goes on.

    lens : the file of a lens that is taken as it is.
    """
    if lens or not run.folder.has_run_of(run.asked):
        return "nothing was kept, since no level had begun; the same command starts again"
    command = f"to go on: {resuming(run.words)}"
    if not run.history:
        return command
    last = run.history[-1]
    reached = min(row.fit for row in run.history if row.stage == last.stage)
    return f"rel_l2 {reached:.3g} so far, on the light that level {last.level} is optimised with; {command}"


def resuming(words: Sequence[str]) -> str:
    """Return the command line, for a shell, that goes on with the design of another one.

    The surface of `--from` stands in the checkpoint.
    """
    kept: list[str] = []
    for before, word in zip(("", *words), words):
        option = "" if "=" in before else before  # whose value is this word
        if not any("--from".startswith(w.partition("=")[0]) and len(w) > 3 for w in (word, option)):
            kept.append(word)
    return shlex.join(["thbcad", *kept, *([] if "--resume" in kept else ["--resume"])])


def _outcome(written: Written, system: System) -> Outcome:
    """Return what is known of a design, and what is printed of it."""
    folder, metrics, checked = written.folder, written.metrics, written.verification
    fit, misses = [], []
    if checked["grade"] == "light misses":
        problem = shlex.quote(str(folder.problem))
        misses = [f"thbcad check {problem} names what binds; {WHAT_HELPS}"]
    if "fresh_fit" in metrics:
        fit = [f"misfit {metrics['fit']:.4f} on the optimiser's rays, {metrics['fresh_fit']:.4f} on others"]
    requested = any(check["subject"] == "light" for check in checked["checks"])
    picture = (
        f"rel_l2 {error_words(metrics)} ({counted_ways(metrics)})   "
        f"psnr {number_text(metrics['psnr_db'], '.2f')} dB   ssim {number_text(metrics['ssim'], '.3f')}"
    )
    lines = [
        Heading("Checks"),
        *check_lines(checked),
        Heading("Light"),
        *fit,
        *[picture] * requested,
        f"efficiency {metrics['efficiency']:.4f}   on the lit region {metrics['lit_efficiency']:.4f}   "
        f"stray {metrics['stray']:.4f}   DOF {metrics['dof']}   evaluations {metrics['evaluations']}   "
        f"{metrics['wall_s']['total']:.1f} s",
        *photometric_lines(metrics, system.units),
        *crosstalk_line(metrics),
        metrics["verdict"],
        *misses,
        f"solid {folder.step}   report {folder.path / 'report.html'}",
    ]
    data = {"folder": str(folder.path), "metrics": metrics, "verify": checked}
    screen = design_screen(metrics, checked, folder.path, misses)
    return Outcome(data, lines, OF_GRADES[checked["grade"]], screen)
