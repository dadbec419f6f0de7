"""What the commands do.  Each returns (data for --json, lines for people, passed)."""

from __future__ import annotations

import resource
import sys
from argparse import Namespace
from collections.abc import Sequence
from importlib import import_module
from math import isinf
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from optics.design import Interrupted
from optics.errors import UserError
from optics.model import (
    base_lens,
    freeforms,
    require_place,
    require_reachable,
    source_profile,
    target_irradiance,
    target_light,
    target_screen,
)
from optics.plan import stages
from optics.problem import load_problem
from optics.problem_text import commented_problem, problem_to_toml
from optics.progress import DesignProgress
from optics.results import ResultFolder
from optics.state import earlier_state

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from optics.backend import Backend
    from optics.problem import Problem
    from optics.state import State
    from thbcad.lens import Lens


CONIC_SLOPE = 2e-9  # about the slope error of a conic's spline that is within 1e-11 mm in height


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


def design(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Shape the lens of a problem file and write the result folder."""
    clock = _Clock()
    problem = load_problem(options.problem)
    if options.resume and options.earlier:
        raise UserError("--resume and --from exclude each other: a resumed run has its surface")
    light, lens = _sound(problem)
    folder = ResultFolder(options.out or Path("exports") / Path(options.problem).stem)
    folder.prepare()
    state = folder.read_checkpoint(problem) if options.resume else None
    if options.earlier:
        state = earlier_state(problem, lens, ResultFolder(options.earlier).read_lens())
    if not options.resume:
        folder.drop_checkpoint()
    for sentence in advice(problem):
        _note(sentence)
    from optics.backend import load_backend

    backend = load_backend(problem.run.precision, problem.run.threads)
    clock.lap("setup")
    try:
        lens, state = _optimise(problem, light, backend, folder, state)
        clock.lap("optimise")
        return _finish(problem, light, lens, state, folder, clock)
    except (KeyboardInterrupt, ImportError) as error:
        if isinstance(error, ImportError) and not isinstance(error.__cause__, KeyboardInterrupt):  # Ctrl-C while OCP is loaded
            raise
        if folder.has_checkpoint():
            _note(f"the same command with --resume goes on from {folder.path}")
        raise KeyboardInterrupt from None


def _optimise(
    problem: Problem, light: NDArray[np.float64], backend: Backend, folder: ResultFolder, state: State | None
) -> tuple[Lens, State]:
    from optics.design import design as run

    progress = DesignProgress()
    try:
        return run(problem, light, backend, state, progress, lambda s: folder.write_checkpoint(problem, s), _note)
    except Interrupted as stop:
        folder.write_checkpoint(problem, stop.state)
        raise KeyboardInterrupt from None
    finally:
        progress.close()


def _note(sentence: str) -> None:
    print(f"thbcad: note: {sentence}", file=sys.stderr)


def _sound(problem: Problem) -> tuple[NDArray[np.float64], Lens]:
    """Return the light asked for and the lens before optimisation; UserError where the problem cannot be solved."""
    light, lens = target_light(problem), base_lens(problem)
    source_profile(problem)
    require_place(problem, lens)
    require_reachable(problem, light)
    return light, lens


def advice(problem: Problem) -> list[str]:
    """Return sentences about settings that do not suit the problem."""
    options, sentences = problem.optimizer, []
    if problem.source.kind == "lambertian" and (options.window == "pixel" or options.lost_flux_weight > 1):
        sentences.append(
            'an extended source blurs its light anyway: optimizer.window = "bspline" and lost_flux_weight = 0 suit it better, '
            "and merged pixels save time (examples/extended.toml)"
        )
    bent = any(not isinf(s.radius) and s.conic != -1 for s in (problem.lens.front, problem.lens.rear))
    thrown = CONIC_SLOPE * problem.target.distance
    if bent and not isinf(thrown) and thrown > problem.verify.landing:
        sentences.append(
            f"STEP holds conics other than paraboloids as splines, which may move landing points by {thrown:.1g} mm at this distance; "
            f"verify.landing = {problem.verify.landing:g} mm may be refused then: use conic = -1, or raise it if that will do"
        )
    return sentences


def _finish(
    problem: Problem, light: NDArray[np.float64], lens: Lens, state: State, folder: ResultFolder, clock: _Clock
) -> tuple[dict[str, Any], list[str], bool]:
    """Export, measure, verify and report a designed lens."""
    from optics.backend import load_backend
    from optics.budget import fans, follows_edges, nonsequential_figures
    from optics.figures import draw_all
    from optics.metrics import measure
    from optics.report import report_html
    from optics.verify import verification, verify
    from thbcad.cad.step import write_step
    from thbcad.files import write_bytes, write_text

    # only now: until then a folder keeps the problem and the lens of an earlier run, which belong together
    folder.write_problem(problem)
    folder.write_lens(lens)
    folder.write_history(state.history)
    write_step(lens, folder.step)
    clock.lap("export")
    exact = load_backend("double", problem.run.threads)
    measurement = measure(exact, problem, lens, light)
    figures, paths = measurement.figures, {}
    if not figures["efficiency"]:
        _note("no light reaches the target; raise optimizer.lost_flux_weight, or make the target larger or nearer to the beam")
    if follows_edges(problem):
        figures["nonsequential_w"] = nonsequential_figures(exact, problem, lens, measurement.target)
        paths = fans(exact, problem, lens)
    clock.lap("measure")
    checked = verification(verify(problem, lens, folder.step, exact))
    folder.write_json("verify.json", checked)
    clock.lap("verify")
    pictures = draw_all(problem, lens, measurement, state.history, paths)
    for name, (_, png) in pictures.items():
        write_bytes(folder.figures / f"{name}.png", png)
    clock.lap("figures")
    metrics = figures | {
        "dof": sum(sag.space.dim for sag in lens.sags),
        "levels": max(sag.space.levels for sag in lens.sags),
        "evaluations": state.evaluations,
        "wall_s": clock.total(),
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    folder.write_json("metrics.json", metrics)
    write_text(folder.path / "report.html", report_html(problem, metrics, checked, pictures, problem_to_toml(folder.read_problem())))
    folder.drop_checkpoint()
    return {"folder": str(folder.path), "metrics": metrics, "verify": checked}, _design_lines(folder, metrics, checked), checked["ok"]


def new(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Print a problem file to start from."""
    text = commented_problem()
    return {"problem": text}, text.splitlines(), True


def check(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Read a problem without tracing."""
    problem = load_problem(options.problem)
    light, lens = _sound(problem)
    screen = target_screen(problem)
    target = target_irradiance(light, screen, problem.target.placing, problem.source.flux)
    least = lens.least_thickness()
    plan = stages(problem, problem.optimizer.start == "transport")
    data = {
        "title": problem.title,
        "picture_pixels": list(light.shape[::-1]),
        "target_pixels": list(screen.pixels),
        "dark_share": float((target <= 0.01 * target.max()).mean()),
        "least_thickness_mm": least.value,
        "least_thickness_at_mm": [least.u, least.v],
        "volume_mm3": lens.volume(),
        "levels": [{"level": s.level, "pixels": list(s.screen.pixels), "rays": list(s.rays), "iterations": s.iterations} for s in plan],
    }
    lines = [
        f"{problem.title}: the problem is sound",
        f"picture {_by(light.shape[::-1])}, target {_by(screen.pixels)} pixels, {data['dark_share']:.0%} of them dark",
        f"least thickness {least.value:.4g} mm at x = {least.u:.4g}, y = {least.v:.4g} mm; volume {data['volume_mm3']:.6g} mm^3",
    ]
    lines += [f"level {s.level}: {_by(s.screen.pixels)} pixels, {_by(s.rays)} rays, {s.iterations} iterations" for s in plan]
    if least.lower <= sum(f.z_freedom for f in freeforms(problem)):
        lines.append("note: z_freedom is larger than the least thickness; a design that uses it fully would be refused")
    lines += [f"note: {sentence}" for sentence in advice(problem)]
    return data, lines, True


def verify(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Check the STEP file of a result folder against its lens, by this program and by others; or a STEP file by itself."""
    from optics.strangers import bare_checks, stranger_checks
    from optics.verify import verification
    from optics.verify import verify as run

    path = Path(options.result)
    try:
        if path.suffix.lower() in (".step", ".stp"):
            checks = bare_checks(path)
        else:
            from optics.backend import load_backend

            folder = ResultFolder(path)
            problem, lens = folder.read_problem(), folder.read_lens()
            backend = load_backend("double", problem.run.threads)
            # first the reader that damaged files cannot crash
            checks = stranger_checks(problem, lens, folder.step, backend)
            checks += run(problem, lens, folder.step, backend)
    except OSError as error:
        raise UserError(f"cannot read {error.filename or path}: {error.strerror}") from None
    except ValueError as error:
        raise UserError(str(error)) from None
    checked = verification(checks)
    return checked, _check_lines(checked), checked["ok"]


def export(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Write the lens for other programs, check the file and store what was found beside it."""
    from optics.export import export as run
    from optics.export import format_of, lens_of
    from optics.verify import verification
    from thbcad.files import json_text, write_text

    name = format_of(options.out, options.format)
    files, checks = run(lens_of(options.result), name, options.out, options.chord)
    data = {"format": name, "files": [str(file) for file in files], "chord_mm": options.chord, **verification(checks)}
    write_text(f"{options.out}.json", json_text(data))
    return data, [*_check_lines(data), *(f"wrote {file}, {file.stat().st_size / 1e6:.3g} MB" for file in files)], data["ok"]


def bench(options: Namespace) -> tuple[list[dict[str, Any]], list[str], bool]:
    """Run a benchmark that lies in the checkout this package was installed from."""
    root = Path(__file__).resolve().parent.parent
    names = sorted(p.stem for p in (root / "benchmarks").glob("*.py") if "\ndef rows(" in p.read_text("utf-8"))
    if options.name not in names:
        raise UserError(f"there is no benchmark {options.name!r}; this installation has: {', '.join(names) or 'none, run from a checkout'}")
    sys.path.insert(0, str(root))
    from benchmarks.rows import machine, table

    rows = import_module(f"benchmarks.{options.name}").rows()
    return [row.plain() for row in rows], [machine(), *table(rows)], all(row.ok for row in rows)


def _shown(value: float | None, form: str) -> str:
    """Return a figure as text, "-" where it is not defined."""
    return "-" if value is None else format(value, form)


def _by(size: Sequence[int]) -> str:
    return f"{size[0]} x {size[1]}"


def _check_lines(checked: dict[str, Any]) -> list[str]:
    lines = []
    for c in checked["checks"]:
        word = "ok    " if c["ok"] else "FAILED"
        lines.append(f"{word} {c['name']}: {c['value']:.3g} {c['unit']}".rstrip() + f" (at most {c['limit']:g})")
    return lines


def _design_lines(folder: ResultFolder, metrics: dict[str, Any], checked: dict[str, Any]) -> list[str]:
    return [
        *_check_lines(checked),
        f"rel_l2 {metrics['rel_l2']:.4f} (floor {metrics['rel_l2_floor']:.4f})   "
        f"psnr {_shown(metrics['psnr_db'], '.2f')} dB   ssim {_shown(metrics['ssim'], '.3f')}",
        f"efficiency {metrics['efficiency']:.4f}   stray {metrics['stray']:.4f}   DOF {metrics['dof']}   "
        f"evaluations {metrics['evaluations']}   {metrics['wall_s']['total']:.1f} s",
        f"solid {folder.step}   report {folder.path / 'report.html'}",
    ]
