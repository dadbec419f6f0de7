"""`thbcad design`: from a problem file to the result folder."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from optics.commands.outcome import Outcome
from optics.commands.progress import DesignProgress
from optics.optimisation import Interrupted, ResultFolder, earlier_state
from optics.problem import limit_checks, load_problem, problem_to_toml
from optics.runtime import UserError, check_lines, note, peak_mb, second_process
from optics.system import OpticalSystem, advice, solvable_system

if TYPE_CHECKING:
    from optics.analysis import Measurement
    from optics.optimisation import Row, State, TransportStart
    from optics.runtime import Backend, SecondProcess
    from optics.tracing import RayPath
    from optics.verification import ExportedStep
    from thbcad.lens import Lens, Manufacturability

LEFT_OUT = "the volume by OCCT's integral, which `thbcad verify` of this folder computes"


class _Clock:
    """Wall time by phase."""

    def __init__(self) -> None:
        self._start = self._mark = perf_counter()
        self.phases: dict[str, float] = {}

    def lap(self, name: str) -> None:
        now = perf_counter()
        self.phases[name] = now - self._mark
        self._mark = now

    def total(self) -> dict[str, float]:
        return {**self.phases, "total": perf_counter() - self._start}


class _Figures:
    """The figures of the report, which a second process draws while this one goes on.

    process : in which they are drawn.
    """

    def __init__(self, process: SecondProcess, system: OpticalSystem) -> None:
        self.process = process
        self._before = process.ask("optics.report", "solid_views", system.lens)

    def draw_lens(self, lens: Lens, history: Sequence[Row]) -> None:
        """Draw what needs no measurement."""
        self._lens = self.process.ask("optics.report", "lens_figures", lens, history)
        self._solid = self.process.ask("optics.report", "solid_views", lens)

    def draw_light(
        self,
        system: OpticalSystem,
        lens: Lens,
        measurement: Measurement,
        fans: Mapping[str, Sequence[RayPath]],
        backend: Backend,
    ) -> None:
        """Draw what the lens delivers; `backend` traces the rays of the scene."""
        from optics.report import scene_paths

        plain, paths = OpticalSystem(system.problem), scene_paths(system, lens, backend)
        self._light = self.process.ask("optics.report", "light_figures", plain, lens, measurement, fans)
        self._scene = self.process.ask(
            "optics.report", "scene_view", plain, lens, measurement.irradiance, paths
        )

    def drawn(self) -> dict[str, tuple[str, bytes]]:
        """Return (caption, PNG) by name, in the order of the report."""
        captions = {
            "scene": "Source, lens and target, seen from behind; rays that miss the target are red.",
            "solid_before": "The solid before optimisation.",
            "solid": "The solid from four sides; the text below says how much steeper its relief is shaded.",
        }
        pictures = {"scene": self._scene, "solid_before": self._before, "solid": self._solid}
        return {
            **self._light.result(),
            **self._lens.result(),
            **{name: (caption, pictures[name].result()) for name, caption in captions.items()},
        }


def design(options: Namespace) -> Outcome:
    """Shape the lens of a problem file and write the result folder."""
    clock = _Clock()
    problem = load_problem(options.problem)
    if options.resume and options.earlier:
        raise UserError("--resume and --from exclude each other: a resumed run has its surface")
    system = solvable_system(problem)
    folder = ResultFolder(options.out or Path("exports") / Path(options.problem).stem)
    folder.prepare()
    for sentence in advice(system):
        note(sentence)
    from optics.optimisation import resolved
    from optics.runtime import load_backend

    with second_process() as beside:
        beside.ask("optics.runtime", "load", "optics.verification", "exported_step")  # OCCT takes a second
        backend = load_backend(problem.run.precision, problem.run.threads)
        system, start = resolved(system, backend)
        state = folder.read_checkpoint(system) if options.resume else None
        if options.earlier:
            state = earlier_state(system, ResultFolder(options.earlier).read_lens())
        if not options.resume:
            folder.drop_checkpoint()
        figures = _Figures(beside, system)
        clock.lap("setup")
        try:
            lens, state = _optimise(system, backend, folder, state, start)
            backend.release()
            clock.lap("optimise")
            return _finish(system, lens, state, folder, clock, figures)
        except KeyboardInterrupt:
            if folder.has_checkpoint():
                note(f"the same command with --resume goes on from {folder.path}")
            raise


def _optimise(
    system: OpticalSystem,
    backend: Backend,
    folder: ResultFolder,
    state: State | None,
    start: TransportStart | None,
) -> tuple[Lens, State]:
    from optics.optimisation import design as run

    progress, problem = DesignProgress(), system.problem
    try:
        return run(
            system, backend, state, progress, lambda s: folder.write_checkpoint(problem, s), note, start
        )
    except Interrupted as stop:
        folder.write_checkpoint(problem, stop.state)
        raise KeyboardInterrupt from None
    finally:
        progress.close()


def _finish(
    system: OpticalSystem, lens: Lens, state: State, folder: ResultFolder, clock: _Clock, figures: _Figures
) -> Outcome:
    """Export, measure, verify and report a designed lens."""
    from optics.etendue import limit_sentence
    from optics.problem import as_data, manufacture_rows
    from optics.report import Report, report_html
    from optics.runtime import load_backend
    from thbcad.io import write_bytes, write_text
    from thbcad.lens import manufacturability

    problem = system.problem
    _store(system, lens, state, folder)
    exported = figures.process.ask(
        "optics.verification", "exported_step", OpticalSystem(problem), lens, folder.step
    )
    figures.draw_lens(lens, state.history)
    clock.lap("export")
    exact = load_backend("double", problem.run.threads)
    measurement, paths = _measured(system, lens, exact)
    figures.draw_light(system, lens, measurement, paths, exact)
    limit = limit_sentence(system, lens, measurement.metrics)
    clock.lap("measure")
    product = manufacturability(lens, problem.lens.density or None)
    folder.write_json("manufacture.json", as_data(product))
    checked = _verified(system, lens, folder, product, exported.result(), exact)
    clock.lap("verify")
    pictures = figures.drawn()
    for name, (_, png) in pictures.items():
        write_bytes(folder.figures / f"{name}.png", png)
    clock.lap("figures")
    metrics = measurement.metrics | _run_metrics(lens, state, clock, figures.process)
    folder.write_json("metrics.json", metrics)
    page = Report(
        problem=problem,
        metrics=metrics,
        verification=checked,
        manufacture=manufacture_rows(product, problem.source.wavelength),
        pictures=pictures,
        limit=limit,
    )
    write_text(folder.path / "report.html", report_html(page, problem_to_toml(folder.read_problem())))
    folder.drop_checkpoint()
    lines = [*_design_lines(folder, metrics, checked), *([limit] if limit else [])]
    data = {"folder": str(folder.path), "metrics": metrics, "verify": checked}
    return Outcome(data, lines, checked["ok"])


def _run_metrics(lens: Lens, state: State, clock: _Clock, beside: SecondProcess) -> dict[str, Any]:
    """Return the metrics of the run itself, by name."""
    return {
        "dof": sum(sag.space.dim for sag in lens.sags),
        "levels": max(sag.space.levels for sag in lens.sags),
        "evaluations": state.evaluations,
        **({"fit": state.result.fit, "fresh_fit": state.result.fresh_fit} if state.result else {}),
        "wall_s": clock.total(),
        "peak_mb": peak_mb() + beside.ask("optics.runtime", "peak_mb").result(),
    }


def _store(system: OpticalSystem, lens: Lens, state: State, folder: ResultFolder) -> None:
    """Write problem, lens and history.

    Only now: until then a folder keeps what belongs to an earlier run.
    """
    folder.write_problem(system.problem)
    folder.write_lens(lens)
    folder.write_history(state.history)


def _measured(
    system: OpticalSystem, lens: Lens, backend: Backend
) -> tuple[Measurement, dict[str, list[RayPath]]]:
    """Return the Measurement of a lens, and fans of rays where light may pass its edges."""
    from optics.analysis import fans, measure, nonsequential_metrics
    from optics.tracing import efficiency_bound

    measurement = measure(system, lens, backend)
    metrics = measurement.metrics | {"efficiency_bound": efficiency_bound(lens.index)}
    if not metrics["efficiency"]:
        note(
            "no light reaches the target; raise optimizer.lost_flux_weight, "
            "or make the target larger or nearer to the beam"
        )
    if not system.path.by_edges:
        return replace(measurement, metrics=metrics), {}
    metrics["nonsequential"] = nonsequential_metrics(system, lens, backend, measurement.target)
    return replace(measurement, metrics=metrics), fans(system, lens, backend)


def _verified(
    system: OpticalSystem,
    lens: Lens,
    folder: ResultFolder,
    product: Manufacturability,
    step: ExportedStep,
    backend: Backend,
) -> dict[str, Any]:
    """Verify the STEP file and the limits of manufacturing, store and return the checks."""
    from optics.runtime import verification
    from optics.verification import StepFile, light_checks, text_volume_check

    checks = [
        *step.checks,
        text_volume_check(StepFile(folder.step).text, lens),
        *light_checks(system, lens, step, backend),
        *limit_checks(system.problem, product),
    ]
    checked = verification(checks) | {"left_out": [LEFT_OUT]}
    folder.write_json("verify.json", checked)
    return checked


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
        f"solid {folder.step}   report {folder.path / 'report.html'}",
    ]
