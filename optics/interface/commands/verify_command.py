"""`thbcad verify`: the STEP file of a result folder against its lens, or a STEP file by itself."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from optics.base.runtime import Check, UserError, check_lines, note, reading, verification
from optics.exchange.results import ResultFolder
from optics.interface.commands.light_of_file import FileLight, LightRequest, light_request
from optics.interface.commands.outcome import OF_GRADES, Outcome
from optics.light.analysis import delivery_checks
from optics.scene.limits import limit_checks
from optics.scene.system import OpticalSystem
from thbcad.doors import pip_command


def verify(options: Namespace) -> Outcome:
    """Check the STEP file of a result folder against its lens, or a STEP file by itself."""
    path = Path(options.result)
    alone = path.suffix.lower() in (".step", ".stp")
    if options.lens is not None and not alone:
        raise UserError(f"--lens says which lens the part in a STEP file holds, and {path} is none")
    request = light_request(options, not alone)
    from optics.exchange.verification import StepFile, bare_checks  # OCCT

    notes: list[str] = []
    left_out: list[str] = []
    light: FileLight | None = None
    if options.lens is not None:
        from optics.exchange.assemblies import part_checks  # OCCT
        from optics.exchange.export import labelled_lens  # other files need none of it
        from optics.exchange.verification import optiland_available  # OCCT

        lens, _ = labelled_lens(options.lens)
        designed = Path(options.lens).is_dir()
        system = OpticalSystem(ResultFolder(options.lens).read().problem) if designed else None
        checks, left_out = part_checks(path, lens, options.optiland and optiland_available(), system)
        if options.optiland and not optiland_available():
            left_out.append(f"rays by optiland, which is not installed; {pip_command('verify')}")
    elif alone:
        file = StepFile(path)
        with reading(path):
            file.read()
        checks, left_out = bare_checks(file)
    else:
        checks, notes, light = _folder_checks(path, options.optiland, request)
        checks += _light_checks(path)
    checked = verification(checks) | {"notes": notes, "left_out": left_out}
    lines = check_lines(checked)
    if light is not None:
        checked["light"] = light.data
        lines += light.lines
    return Outcome(checked, lines, OF_GRADES[checked["grade"]])


def _light_checks(path: Path) -> list[Check]:
    """Return the checks of the light that a result folder holds; not decided where that is not whole."""
    from optics.interface.api import Design  # a file by itself needs none of it

    try:
        design = Design.load(path)
    except UserError as error:
        return [Check("light of the result", None, 0.0, "", subject="light", remark=str(error))]
    return delivery_checks(design.measurement.metrics, design.problem.verify)


def _folder_checks(
    path: Path, by_optiland: bool, request: LightRequest | None
) -> tuple[list[Check], list[str], FileLight | None]:
    """Return the checks of the STEP file of a result folder, notes, and the light that is asked for."""
    from optics.exchange.verification import (  # OCCT
        StepFile,
        fresh_export_checks,
        optiland_available,
        optiland_checks,
        prescription_checks,
        text_and_occt_checks,
        verify as run,
    )

    folder = ResultFolder(path)
    problem, lens, _ = folder.read()
    system = OpticalSystem(problem)
    backend = system.backend
    file = StepFile(folder.step)
    with reading(file.path):
        file.read_lens()
    checks, notes = fresh_export_checks(system, lens, file)
    checks += prescription_checks(problem, lens)
    checks += text_and_occt_checks(system, lens, file, backend)
    checks += run(system, lens, file, backend)
    checks += limit_checks(problem, system.manufactured(lens))
    if by_optiland and len(system.own_faces) > 2:
        note("optiland does not trace the file: it traces no reflection inside a lens")
    elif by_optiland and optiland_available():
        checks += optiland_checks(system, lens, file, backend)
    elif by_optiland:
        note(f"optiland is not installed and does not trace the file; {pip_command('verify')}")
    if request is None:
        return checks, notes, None
    light = request.answered(system, lens, file, backend)
    return checks + light.checks, notes, light
