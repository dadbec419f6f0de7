"""`thbcad design`: from a problem file to the result folder."""

from __future__ import annotations

import resource
from argparse import Namespace
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Thread
from time import perf_counter
from typing import TYPE_CHECKING, Any

from optics.commands.outcome import Outcome
from optics.commands.progress import DesignProgress
from optics.optimisation import Interrupted, ResultFolder, earlier_state
from optics.problem import limit_checks, load_problem, problem_to_toml
from optics.runtime import UserError, check_lines, note
from optics.system import advice, solvable_system

if TYPE_CHECKING:
    from optics.analysis import Measurement
    from optics.optimisation import State, TransportStart
    from optics.runtime import Backend
    from optics.system import OpticalSystem
    from optics.tracing import RayPath
    from thbcad.lens import Lens, Manufacturability


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

    backend = load_backend(problem.run.precision, problem.run.threads)
    system, start = resolved(system, backend)
    state = folder.read_checkpoint(system) if options.resume else None
    if options.earlier:
        state = earlier_state(system, ResultFolder(options.earlier).read_lens())
    if not options.resume:
        folder.drop_checkpoint()
    clock.lap("setup")
    Thread(target=_load_ahead, daemon=True).start()
    try:
        lens, state = _optimise(system, backend, folder, state, start)
        clock.lap("optimise")
        return _finish(system, lens, state, folder, clock)
    except (KeyboardInterrupt, ImportError) as error:
        # an ImportError is an interruption where Ctrl-C came while OCP was loaded
        if isinstance(error, ImportError) and not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        if folder.has_checkpoint():
            note(f"the same command with --resume goes on from {folder.path}")
        raise KeyboardInterrupt from None


def _load_ahead() -> None:
    """Load what the end of a run needs while the optimiser works: OCCT alone takes a second."""
    with suppress(ImportError):  # the run meets it again, and says so
        from optics.report import draw_all  # noqa: F401
        from optics.verification import verify  # noqa: F401
        from thbcad.cad import write_step  # noqa: F401


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


def _finish(system: OpticalSystem, lens: Lens, state: State, folder: ResultFolder, clock: _Clock) -> Outcome:
    """Export, measure, verify and report a designed lens."""
    from optics.etendue import limit_sentence
    from optics.problem import as_data, manufacture_rows
    from optics.report import Report, draw_all, report_html
    from optics.runtime import load_backend
    from thbcad.io import write_bytes, write_text
    from thbcad.lens import manufacturability

    problem = system.problem
    _store(system, lens, state, folder)
    clock.lap("export")
    exact = load_backend("double", problem.run.threads)
    measurement, paths = _measured(system, lens, exact)
    limit = limit_sentence(system, lens, measurement.metrics)
    clock.lap("measure")
    product = manufacturability(lens, problem.lens.density or None)
    folder.write_json("manufacture.json", as_data(product))
    checked = _verified(system, lens, folder, product, exact)
    clock.lap("verify")
    pictures = draw_all(system, lens, measurement, state.history, paths)
    pictures |= _solids(system, lens, measurement, exact)
    for name, (_, png) in pictures.items():
        write_bytes(folder.figures / f"{name}.png", png)
    clock.lap("figures")
    metrics = measurement.metrics | _run_metrics(lens, state, clock)
    folder.write_json("metrics.json", metrics)
    rows = manufacture_rows(product, problem.source.wavelength)
    page = Report(
        problem=problem,
        metrics=metrics,
        verification=checked,
        manufacture=rows,
        pictures=pictures,
        limit=limit,
    )
    write_text(folder.path / "report.html", report_html(page, problem_to_toml(folder.read_problem())))
    folder.drop_checkpoint()
    lines = [*_design_lines(folder, metrics, checked), *([limit] if limit else [])]
    data = {"folder": str(folder.path), "metrics": metrics, "verify": checked}
    return Outcome(data, lines, checked["ok"])


def _run_metrics(lens: Lens, state: State, clock: _Clock) -> dict[str, Any]:
    """Return the metrics of the run itself, by name."""
    return {
        "dof": sum(sag.space.dim for sag in lens.sags),
        "levels": max(sag.space.levels for sag in lens.sags),
        "evaluations": state.evaluations,
        "wall_s": clock.total(),
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def _store(system: OpticalSystem, lens: Lens, state: State, folder: ResultFolder) -> None:
    """Write problem, lens, history and STEP file.

    Only now: until then a folder keeps what belongs to an earlier run.
    """
    from thbcad.cad import write_step

    folder.write_problem(system.problem)
    folder.write_lens(lens)
    folder.write_history(state.history)
    write_step(lens, folder.step, system.product, system.problem.export.schema)


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
    system: OpticalSystem, lens: Lens, folder: ResultFolder, product: Manufacturability, backend: Backend
) -> dict[str, Any]:
    """Verify the STEP file and the limits of manufacturing, store and return the checks."""
    from optics.runtime import verification
    from optics.verification import StepFile, verify

    checks = verify(system, lens, StepFile(folder.step), backend) + limit_checks(system.problem, product)
    checked = verification(checks)
    folder.write_json("verify.json", checked)
    return checked


def _solids(
    system: OpticalSystem, lens: Lens, measurement: Measurement, exact: Backend
) -> dict[str, tuple[str, bytes]]:
    """Return (caption, PNG) of the scene, and of the lens before and after, by name."""
    from optics.report import scene_paths, scene_view, solid_views

    scene = scene_view(system, lens, measurement.irradiance, scene_paths(system, lens, exact))
    return {
        "scene": ("Source, lens and target, seen from behind; rays that miss the target are red.", scene),
        "solid_before": ("The solid before optimisation.", solid_views(system.lens)),
        "solid": (
            "The solid from four sides; the text below says how much steeper its relief is shaded.",
            solid_views(lens),
        ),
    }


def _shown(value: float | None, form: str) -> str:
    """Return a metric as text, "-" where it is not defined."""
    return "-" if value is None else format(value, form)


def _design_lines(folder: ResultFolder, metrics: dict[str, Any], checked: dict[str, Any]) -> list[str]:
    return [
        *check_lines(checked),
        f"rel_l2 {metrics['rel_l2']:.4f} (floor {metrics['rel_l2_floor']:.4f})   "
        f"psnr {_shown(metrics['psnr_db'], '.2f')} dB   ssim {_shown(metrics['ssim'], '.3f')}",
        f"efficiency {metrics['efficiency']:.4f}   stray {metrics['stray']:.4f}   DOF {metrics['dof']}   "
        f"evaluations {metrics['evaluations']}   {metrics['wall_s']['total']:.1f} s",
        f"solid {folder.step}   report {folder.path / 'report.html'}",
    ]
