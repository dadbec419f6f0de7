"""What the commands do.  Each returns (data for --json, lines for people, passed)."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optics.design_run import design
from optics.errors import UserError
from optics.etendue_run import etendue, etendue_note
from optics.limits import limit_checks
from optics.model import freeforms, target_irradiance, target_screen
from optics.plan import stages
from optics.problem import load_problem
from optics.problem_text import commented_problem
from optics.results import ResultFolder
from optics.skips import skip_lines, skips
from optics.soundness import advice, sound
from optics.text import check_lines, note
from optics.trace_run import trace

if TYPE_CHECKING:
    from thbcad.flange import Flange

__all__ = ["bench", "check", "design", "etendue", "export", "new", "trace", "verify"]


def new(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Print a problem file to start from."""
    text = commented_problem()
    return {"problem": text}, text.splitlines(), True


def check(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Read a problem without tracing."""
    problem = load_problem(options.problem)
    light, lens = sound(problem)
    screen = target_screen(problem)
    target = target_irradiance(light, screen, problem.target.placing, problem.source.flux)
    least = lens.least_thickness()
    plan, found = stages(problem, problem.optimizer.start == "transport"), skips(problem)
    data = {
        "title": problem.title,
        "picture_pixels": list(light.shape[::-1]),
        "target_pixels": list(screen.pixels),
        "dark_share": float((target <= 0.01 * target.max()).mean()),
        "least_thickness_mm": least.value,
        "least_thickness_at_mm": [least.u, least.v],
        "volume_mm3": lens.volume(),
        "skips": [asdict(skip) for skip in found],
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
    lines += skip_lines(found)
    lines += [f"note: {sentence}" for sentence in [*advice(problem, lens), *etendue_note(problem, light)]]
    return data, lines, True


def verify(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Check the STEP file of a result folder against its lens, by this program and by others; or a STEP file by itself."""
    from optics.checks import verification
    from optics.optiland_trace import optiland_available, optiland_checks
    from optics.step_file import StepFile
    from optics.strangers import bare_checks, stranger_checks
    from optics.verify import verify as run
    from thbcad.manufacture import manufacturability

    path = Path(options.result)
    try:
        if path.suffix.lower() in (".step", ".stp"):
            checks = bare_checks(StepFile(path))
        else:
            from optics.backend import load_backend

            folder = ResultFolder(path)
            problem, lens = folder.read_problem(), folder.read_lens()
            backend = load_backend("double", problem.run.threads)
            file = StepFile(folder.step)
            # first the reader that damaged files cannot crash
            checks = stranger_checks(problem, lens, file, backend)
            checks += run(problem, lens, file, backend)
            checks += limit_checks(problem, manufacturability(lens, problem.lens.density or None))
            if options.optiland and optiland_available():
                checks += optiland_checks(problem, lens, file, backend)
            elif options.optiland:
                note("optiland is not installed and does not trace the file: pip install thbcad[verify]")
    except OSError as error:
        raise UserError(f"cannot read {error.filename or path}: {error.strerror}") from None
    except ValueError as error:
        raise UserError(str(error)) from None
    checked = verification(checks)
    return checked, check_lines(checked), checked["ok"]


def export(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Write the lens for other programs, check the file and store what was found beside it."""
    from optics.bodies import Body
    from optics.checks import verification
    from optics.export import export as run
    from optics.export import format_of, labelled_lens
    from thbcad.files import json_text, write_text

    name = format_of(options.out, options.format)
    body = Body(options.aperture and tuple(options.aperture), _flange(options.flange), options.patches, options.separate)
    lens, labels = labelled_lens(options.result)
    files, checks = run(lens, name, options.out, options.chord, body, labels)
    data = {"format": name, "files": [str(file) for file in files], "chord_mm": options.chord, **verification(checks)}
    write_text(f"{options.out}.json", json_text(data))
    return data, [*check_lines(data), *(f"wrote {file}, {file.stat().st_size / 1e6:.3g} MB" for file in files)], data["ok"]


def _flange(numbers: Sequence[float] | None) -> Flange | None:
    """Return the flange that --flange asks for.

    Raises
    ------
    UserError : numbers that make none.
    """
    from thbcad.flange import Flange

    try:
        return None if numbers is None else Flange(*numbers)
    except ValueError as error:
        raise UserError(f"--flange: {error}") from None


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


def _by(size: Sequence[int]) -> str:
    return f"{size[0]} x {size[1]}"
