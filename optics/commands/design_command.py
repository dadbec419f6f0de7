"""`thbcad design`: from a problem file to the result folder."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from optics.commands.design_figures import DesignFigures
from optics.commands.notes import Notes
from optics.commands.outcome import Outcome
from optics.commands.progress import DesignProgress, Size
from optics.optimisation import Interrupted, earlier_state, stages
from optics.problem import limit_checks
from optics.results import ResultFolder, ResultWriter, read_checkpoint, write_checkpoint
from optics.runtime import UserError, check_lines, peak_mb, second_process
from optics.system import OpticalSystem, advice, load_system

if TYPE_CHECKING:
    from optics.analysis import Measurement
    from optics.optimisation import State, TransportStart
    from optics.problem import Problem
    from optics.runtime import Backend, Check
    from optics.tracing import RayPath
    from optics.verification import ExportedStep
    from thbcad.lens import Lens, Manufacturability

LEFT_OUT = "the volume by OCCT's integral, which `thbcad verify` of this folder computes"


class _Clock:
    """Wall time by phase, and the progress that is told of it."""

    def __init__(self, progress: DesignProgress) -> None:
        self.progress = progress
        self._start = self._mark = perf_counter()
        self.phases: dict[str, float] = {}

    def lap(self, name: str) -> None:
        now = perf_counter()
        self.phases[name] = now - self._mark
        self._mark = now
        self.progress.over(name)

    def total(self) -> dict[str, float]:
        return {**self.phases, "total": perf_counter() - self._start}


@dataclass(frozen=True)
class _Run:
    """One design on its way.  asked : the problem as it was read."""

    asked: Problem
    folder: ResultFolder
    clock: _Clock
    notes: Notes = field(default_factory=Notes)


def design(options: Namespace) -> Outcome:
    """Shape the lens of a problem file and write the result folder."""
    clock = _Clock(DesignProgress())
    if options.resume and options.earlier:
        raise UserError("--resume and --from exclude each other: a resumed run has its surface")
    if options.iterations is not None and (not options.resume or options.iterations < 1):
        raise UserError("--iterations takes a number from 1 on, and needs --resume")
    system = load_system(options.problem)
    problem = system.problem
    folder = ResultFolder(options.out or Path("exports") / Path(options.problem).stem)
    run = _Run(problem, folder, clock)
    with folder.taken(problem, options.force or (options.resume and folder.checkpoint.exists())):
        try:
            return _designed(run, system, options)
        except KeyboardInterrupt:
            run.notes(_what_is_kept(run))
            raise


def _designed(run: _Run, system: OpticalSystem, options: Namespace) -> Outcome:
    from optics.prediction import resolved
    from optics.runtime import load_backend

    with run.clock.progress, second_process() as beside:
        beside.ask("optics.runtime", "load", "optics.verification", "exported_step")  # OCCT takes a second
        backend = load_backend(run.asked.run.precision, run.asked.run.threads)
        system, start = resolved(system, backend)
        for sentence in advice(system):
            run.notes(sentence)
        state = _resumed(run, system) if options.resume else None
        if options.iterations:
            system = _with_iterations(system, options.iterations)
        if options.earlier:
            state = earlier_state(system, ResultFolder(options.earlier).read_lens())
        figures = DesignFigures(beside, system)
        moved = state.moved if state else system.problem.optimizer.start == "transport"
        run.clock.progress.planned(Size.of(system), stages(system, moved))
        run.clock.lap("setup")
        lens, state = _optimised(run, system, backend, state, start)
        backend.release()
        run.clock.lap("optimise")
        return _finished(run, system, lens, state, figures)


def _resumed(run: _Run, system: OpticalSystem) -> State:
    """Return the state of the checkpoint, or that of the finished result of the same problem."""
    if run.folder.checkpoint.exists() or not run.folder.is_result_of(run.asked):
        state, earlier = read_checkpoint(run.folder.checkpoint, system)
        run.notes.extend(earlier)
        return state
    run.notes(f"goes on from the finished result in {run.folder.path}, on its last level")
    return earlier_state(system, run.folder.read(taken=True).lens)


def _with_iterations(system: OpticalSystem, iterations: int) -> OpticalSystem:
    optimizer = replace(system.problem.optimizer, iterations=(iterations,))
    return OpticalSystem(replace(system.problem, optimizer=optimizer))


def _what_is_kept(run: _Run) -> str:
    if run.folder.has_run_of(run.asked):
        return f"the same command with --resume goes on from {run.folder.checkpoint}"
    return "nothing was kept, since no level had begun; the same command starts again"


def _optimised(
    run: _Run, system: OpticalSystem, backend: Backend, state: State | None, start: TransportStart | None
) -> tuple[Lens, State]:
    from optics.engines import ExactEngine
    from optics.optimisation import design as shape

    def keep(state: State) -> None:
        write_checkpoint(run.folder.checkpoint, run.asked, system.problem, state, run.notes)

    try:
        return shape(system, backend, ExactEngine(backend), state, run.clock.progress, keep, run.notes, start)
    except Interrupted as stop:
        keep(stop.state)
        raise KeyboardInterrupt from None


def _finished(run: _Run, system: OpticalSystem, lens: Lens, state: State, figures: DesignFigures) -> Outcome:
    """Export, measure and verify a designed lens; then write what can be claimed of it."""
    from optics.etendue import limit_sentence
    from optics.report import light_files
    from optics.runtime import load_backend
    from thbcad.lens import manufacturability

    problem, clock = system.problem, run.clock
    writer = ResultWriter(run.folder, problem, lens, state.history)
    exported = figures.process.ask(
        "optics.verification", "exported_step", OpticalSystem(problem), lens, writer.staged_step
    )
    figures.draw_lens(lens, state.history, stages(system, state.moved))
    clock.lap("export")
    exact = load_backend("double", problem.run.threads)
    measurement, paths = _measured(run, system, lens, exact)
    figures.draw_light(system, lens, measurement, paths, exact)
    limit = limit_sentence(system, lens, measurement.metrics)
    if limit:
        run.notes(limit)
    clock.lap("measure")
    product = manufacturability(lens, problem.lens.density or None)
    step = exported.result()
    writer.place_step()
    checks = _checks(run, system, lens, product, step, exact, measurement)
    clock.lap("verify")
    pictures = figures.drawn()
    files = light_files(measurement.irradiance, measurement.target, system.target.screen())
    for name, data in files.items():
        writer.write(name, data)
    for name, (_, png) in pictures.items():
        writer.write(f"figures/{name}.png", png)
    clock.lap("figures")
    metrics = measurement.metrics | _run_metrics(lens, state, run, figures)
    return _claimed(run, writer, system, metrics, checks, product, pictures, figures.view())


def _claimed(
    run: _Run,
    writer: ResultWriter,
    system: OpticalSystem,
    metrics: dict[str, Any],
    checks: list[Check],
    product: Manufacturability,
    pictures: dict[str, tuple[str, bytes]],
    view: str,
) -> Outcome:
    """Write what is now known of the lens, the record last, and return the outcome."""
    from optics.analysis import verdict
    from optics.problem import as_data, manufacture_rows
    from optics.report import Report, report_html
    from optics.runtime import verification

    says: dict[str, Any] = {"verdict": verdict(checks), "notes": list(run.notes)}
    writer.write_claims("manufacture.json", as_data(product))
    checked = writer.write_claims("verify.json", verification(checks) | {"left_out": [LEFT_OUT]})
    page = Report(
        problem=system.problem,
        metrics=metrics,
        verification=checked,
        manufacture=manufacture_rows(product, system.problem.source.wavelength),
        pictures=pictures,
        verdict=says["verdict"],
        notes=says["notes"],
        run=writer.run,
        view=view,
    )
    metrics = writer.write_claims("metrics.json", metrics | says)
    writer.write("report.html", report_html(page, writer.problem_text).encode())
    writer.finish(run.asked, {"ok": checked["ok"], **says})
    run.folder.checkpoint.unlink(missing_ok=True)
    data = {"folder": str(run.folder.path), "metrics": metrics, "verify": checked}
    return Outcome(data, _design_lines(run.folder, metrics, checked), checked["ok"])


def _run_metrics(lens: Lens, state: State, run: _Run, figures: DesignFigures) -> dict[str, Any]:
    """Return the metrics of the run itself, by name."""
    return {
        "dof": sum(sag.space.dim for sag in lens.sags),
        "levels": max(sag.space.levels for sag in lens.sags),
        "evaluations": state.evaluations,
        **({"fit": state.result.fit, "fresh_fit": state.result.fresh_fit} if state.result else {}),
        "wall_s": run.clock.total(),
        "peak_mb": peak_mb() + figures.process.ask("optics.runtime", "peak_mb").result(),
    }


def _measured(
    run: _Run, system: OpticalSystem, lens: Lens, backend: Backend
) -> tuple[Measurement, dict[str, list[RayPath]]]:
    """Return the Measurement of a lens, and fans of rays where light may pass its edges."""
    from optics.analysis import fans, loss_notes, measure, nonsequential_metrics
    from optics.tracing import efficiency_bound

    measurement = measure(system, lens, backend)
    metrics = measurement.metrics | {"efficiency_bound": efficiency_bound(lens.index)}
    for sentence in loss_notes(metrics):
        run.notes(sentence)
    if not metrics["efficiency"]:
        run.notes(
            "no light reaches the target; raise optimizer.lost_flux_weight, "
            "or make the target larger or nearer to the beam"
        )
    if not system.path.by_edges:
        return replace(measurement, metrics=metrics), {}
    metrics["nonsequential"] = nonsequential_metrics(system, lens, backend, measurement.target)
    return replace(measurement, metrics=metrics), fans(system, lens, backend)


def _checks(
    run: _Run,
    system: OpticalSystem,
    lens: Lens,
    product: Manufacturability,
    step: ExportedStep,
    backend: Backend,
    measurement: Measurement,
) -> list[Check]:
    """Return the checks of the STEP file, of what the lens delivers, and of the limits of manufacturing."""
    from optics.analysis import delivery_checks
    from optics.verification import StepFile, light_checks, text_volume_check

    return [
        *step.checks,
        text_volume_check(StepFile(run.folder.step).text, lens),
        *light_checks(system, lens, step, backend),
        *delivery_checks(measurement.metrics, system.problem.verify),
        *limit_checks(system.problem, product),
    ]


def _shown(value: float | None, form: str) -> str:
    """Return a metric as text, "-" where it is not defined."""
    return "-" if value is None else format(value, form)


def _design_lines(folder: ResultFolder, metrics: dict[str, Any], checked: dict[str, Any]) -> list[str]:
    fit = []
    if "fresh_fit" in metrics:
        fit = [f"misfit {metrics['fit']:.4f} on the optimiser's rays, {metrics['fresh_fit']:.4f} on others"]
    return [
        *check_lines(checked),
        *fit,
        f"rel_l2 {metrics['rel_l2']:.4f} (floor {metrics['rel_l2_floor']:.4f})   "
        f"psnr {_shown(metrics['psnr_db'], '.2f')} dB   ssim {_shown(metrics['ssim'], '.3f')}",
        f"efficiency {metrics['efficiency']:.4f}   stray {metrics['stray']:.4f}   DOF {metrics['dof']}   "
        f"evaluations {metrics['evaluations']}   {metrics['wall_s']['total']:.1f} s",
        metrics["verdict"],
        f"solid {folder.step}   report {folder.path / 'report.html'}",
    ]
