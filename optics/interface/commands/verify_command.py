"""`thbcad verify`: the STEP file of a result folder against its lens, or a STEP file by itself; with --light
an independent program makes its light.
"""

from __future__ import annotations

from argparse import Namespace
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from optics.base.runtime import (
    Backend,
    Check,
    HelperProcess,
    UserError,
    check_lines,
    note,
    process_for,
    reading,
    verification,
)
from optics.exchange.results import SCENE, ResultFolder, require_own, writable_folder, write_recorded
from optics.exchange.verification import StepFile
from optics.interface.commands.outcome import OF_GRADES, Outcome
from optics.interface.screens import verify_screen
from optics.light.analysis import delivery_checks
from optics.scene.limits import limit_checks
from optics.scene.system import (
    System,
    designed_part,
    manufactured,
    other_limit_checks,
    other_parts,
)
from thbcad.doors import pip_command


class FileLight(NamedTuple):
    """What `verify --light` adds: checks, numbers by name, lines of text."""

    checks: list[Check]
    data: dict[str, Any]
    lines: list[str]


@dataclass(frozen=True)
class LightRequest:
    """A program that is to make the light of the STEP file, with `rays` rays.

    folder : where its picture and its numbers are written.
    """

    tracer: str
    rays: int
    folder: Path

    @property
    def names(self) -> tuple[str, str, str]:
        """The files of the picture, of a page that shows it with the numbers, and of the numbers."""
        picture, page, record = (f"light_{self.tracer}.{suffix}" for suffix in ("png", "html", "json"))
        return picture, page, record

    def answered(self, system: System, file: StepFile, backend: Backend) -> FileLight:
        """Trace the file, write picture and numbers, and return the FileLight.

        Raises UserError : the file cannot be read, or is no lens; as `file_tracer`.
        """
        from optics.exchange.cross_checks import (  # OCCT
            compare_light,
            file_tracer,
            light_comparison_checks,
            light_comparison_lines,
        )
        from optics.reporting.figures import two_lights_figure  # matplotlib
        from optics.reporting.report import check_page  # few runs ask

        note(f"{self.tracer} traces {self.rays} rays through the STEP file")
        with reading(file.path):
            tracer = file_tracer(self.tracer, file, system)
        found = compare_light(system, tracer, self.rays, backend)
        checks = light_comparison_checks(found, system.traced_within)
        checked, lines = verification(checks), light_comparison_lines(found)
        image, page, record = self.names
        picture = two_lights_figure(found.theirs, found.ours, found.screen, system.density, self.tracer)
        of = "lens.step" if system.problem.optic.array is None else "one lens of the plate of lens.step"
        title = f"{system.problem.title}: the light of {of} by {self.tracer}"
        caption = f"The light of {of} as {self.tracer} makes it, the lens's own, and their difference."
        shown = check_page(title, checked, lines, [(caption, picture)]).encode()
        data = found.metrics | {"light_of": of} | checked
        if system.problem.optic.array is not None:
            lines.append(f"this is the light of {of}, of its own source")
        write_recorded(self.folder, record, data, {image: picture, page: shown})
        return FileLight(checks, data, [*lines, f"wrote {self.folder}"])


def light_request(options: Namespace, of_folder: bool) -> LightRequest | None:
    """Return what is asked of an independent program, None for nothing.

    of_folder : whether a result folder is verified, not a STEP file.

    Raises UserError : options that do not fit together, a program that is not installed, a number of rays
        that it cannot trace, a folder that cannot be written or holds what this program did not write.
    """
    if options.light is None:
        for name in ("rays", "out", "force"):
            if getattr(options, name):
                raise UserError(f"--{name} goes with --light; name the program that traces the STEP file")
        return None
    if not of_folder:
        raise UserError(
            "--light compares with the light of a design: give its result folder, got the file "
            f"{options.result}"
        )
    from optics.exchange.cross_checks import require_traced, require_tracer  # few runs ask

    rays = require_tracer(options.light, None if options.rays is None else _count(options.rays))
    if not (Path(options.result) / "problem.toml").exists():
        raise UserError(f"{options.result} is not a result folder: it has no problem.toml")
    require_traced(ResultFolder(options.result).read().system)
    request = LightRequest(options.light, rays, Path(options.out or Path(options.result) / "verify_light"))
    writable_folder(request.folder)
    require_own(request.folder, request.names, request.names[-1], options.force)
    return request


def _count(text: str) -> int:
    """Return a whole number; 1e7 is one too."""
    try:
        number = float(text)
        if number != int(number):
            raise ValueError
        return int(number)
    except (ValueError, OverflowError):
        raise UserError(f"--rays must be a whole number such as 100000 or 1e5, got {text!r}") from None


def verify(options: Namespace) -> Outcome:
    """Check the STEP file of a result folder against its lens, or a STEP file by itself."""
    path = Path(options.result)
    alone = path.suffix.lower() in (".step", ".stp")
    if options.lens is not None and not alone:
        raise UserError(f"--lens says which lens the part in a STEP file holds, and {path} is none")
    request = light_request(options, not alone)
    from optics.exchange.verification import bare_checks, unit_note  # OCCT

    notes: list[str] = []
    left_out: list[str] = []
    light: FileLight | None = None
    if options.lens is not None:
        from optics.exchange.assemblies import part_checks  # OCCT
        from optics.exchange.export import labelled_lens  # other files need none of it
        from optics.exchange.verification import optiland_available  # OCCT

        lens, _ = labelled_lens(options.lens)
        designed = Path(options.lens).is_dir()
        system = ResultFolder(options.lens).read().system if designed else None
        checks, left_out = part_checks(path, lens, options.optiland and optiland_available(), system)
        if options.optiland and not optiland_available():
            left_out.append(f"rays by optiland, which is not installed; {pip_command('verify')}")
    elif alone:
        file = StepFile(path)
        with reading(path):
            file.read()
        checks, left_out = bare_checks(file)
        notes = unit_note(file)
    else:
        with process_for("optiland", forked=True) if options.optiland else nullcontext() as beside:
            checks, notes, light = _folder_checks(path, beside, request)
        checks += _light_checks(path)
    checked = verification(checks) | {"notes": notes, "left_out": left_out}
    lines = check_lines(checked)
    if light is not None:
        checked["light"] = light.data
        lines += light.lines
    screen = verify_screen(checked, _compared(path, options.lens, alone), light.lines if light else ())
    return Outcome(checked, lines, OF_GRADES[checked["grade"]], screen)


def _compared(path: Path, lens: str | None, alone: bool) -> str:
    """Return which file was checked, and with what it agrees where all checks pass."""
    if lens is not None:
        return f"the part in {path} holds the lens of {lens}"
    return f"{path} is a sound solid" if alone else f"{path / 'lens.step'} is the designed surface"


def _light_checks(path: Path) -> list[Check]:
    """Return the checks of the light that a result folder holds; not decided where that is not whole."""
    from optics.interface.api import Design  # a file by itself needs none of it

    try:
        design = Design.load(path)
    except UserError as error:
        return [Check("light of the result", None, 0.0, "", subject="light", remark=str(error))]
    return delivery_checks(design.measurement.metrics, design.problem.verify)


def _folder_checks(
    path: Path, beside: HelperProcess | None, request: LightRequest | None
) -> tuple[list[Check], list[str], FileLight | None]:
    """Return the checks of the STEP file of a result folder, notes, and the light that is asked for.

    beside : where optiland traces the file; None is nowhere.
    """
    from optics.exchange.verification import (  # OCCT
        fresh_export_checks,
        optiland_available,
        other_part_checks,
        prescription_checks,
        text_and_occt_checks,
        verify as run,
    )

    if beside and optiland_available():
        beside.ask("optics.base.runtime", "load", "optiland.geometries", "NurbsGeometry")
    folder = ResultFolder(path)
    system = folder.read().system
    file = StepFile(folder.step)
    with reading(file.path):
        file.read_lens()
    by_optiland = _by_optiland(beside, system, file) if beside else None
    problem, backend = system.problem, system.backend
    designed = designed_part(system)
    checks, notes = fresh_export_checks(designed, problem.export.schema, file)
    checks += prescription_checks(problem, system.designed, given=not folder.read_history())
    checks += text_and_occt_checks(system, file, backend)
    checks += run(system, file, backend)
    for part in other_parts(system):
        own = StepFile(folder.path / part.file)
        with reading(own.path):
            own.read_lens()
        checks += other_part_checks(part, own, problem)
    if system.others:
        from optics.exchange.assemblies import scene_checks, scene_text_check  # few runs ask

        files = {part.name: folder.path / part.file for part in other_parts(system)}
        files[designed.name] = folder.step
        with reading(folder.path / SCENE):
            checks += scene_checks(system, folder.path / SCENE)
            checks.append(scene_text_check(system, folder.path / SCENE, files))
    checks += limit_checks(problem, manufactured(system)) + other_limit_checks(system)
    checks += by_optiland.result() if by_optiland else []
    if request is None:
        return checks, notes, None
    light = request.answered(system, file, backend)
    return checks + light.checks, notes, light


def _by_optiland(beside: HelperProcess, system: System, file: StepFile) -> Future[list[Check]] | None:
    """Return what optiland will find in a file, in a process beside this one; None where it traces no such.

    To load it and to trace takes as long as all other checks.
    """
    from optics.exchange.verification import optiland_available  # OCCT

    if len(system.own_faces) > 2:
        note("optiland does not trace the file: it traces no reflection inside a lens")
    elif not file.has_rims:
        note("optiland does not trace the file: the rims beside its roundings are splines that are not read")
    elif not optiland_available():
        note(f"optiland is not installed and does not trace the file; {pip_command('verify')}")
    else:
        room = "optics.exchange.verification"
        return beside.ask(room, "optiland_checks", system, StepFile(file.path.absolute()))
    return None
