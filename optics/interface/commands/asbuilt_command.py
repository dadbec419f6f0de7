"""`thbcad asbuilt`: the light of a lens as it was made, beside that of its design."""

from __future__ import annotations

from argparse import Namespace
from io import BytesIO
from pathlib import Path

import numpy as np

from optics.base.runtime import NumericalError
from optics.exchange.results import beside, remove_files, require_own, writable_folder, write_record
from optics.interface.api import Design
from optics.interface.commands.outcome import OF_GRADES, Outcome
from optics.light.analysis import loss_notes
from optics.scene.system import designed_part
from optics.tolerancing.metrology import FileFrame, Way, as_built_data, as_built_lines
from thbcad.io import write_files, write_lens

RECORD = "asbuilt.json"
FILES = ("lens.json", "light.png", "errors.png", "irradiance.npz")
STEP = "lens.step"  # where it is asked for


def asbuilt(options: Namespace) -> Outcome:
    """Measure the light of a made lens."""
    folder = Path(options.out or Path(options.result) / "asbuilt")
    design = Design.load(options.result)
    writable_folder(folder)
    require_own(folder, (*FILES, STEP, RECORD), RECORD, options.force)
    frame = FileFrame(
        unit=options.unit,
        height_unit=options.height_unit,
        kind="errors" if options.errors else "heights",
        mirror=options.mirror,
        turn=options.turn,
        down=options.down,
        centre=options.centre,
    )
    way: Way = "best fit" if options.align == "best-fit" else "datums"
    built = design.as_built(options.measured, frame, options.surface, way)
    from optics.reporting.figures import height_error_figure, made_light_figure  # matplotlib

    made, packed = built.measurement, BytesIO()
    np.savez_compressed(packed, made=made.irradiance, designed=built.nominal.irradiance, target=made.target)
    contents = {
        "irradiance.npz": packed.getvalue(),
        "light.png": made_light_figure(built, design.system.target.screen()),
        "errors.png": height_error_figure(built),
    }
    write_lens(built.lens, folder / "lens.json")
    write_files({folder / name: content for name, content in contents.items()})
    remove_files(folder, [STEP])
    if options.step:
        from optics.exchange.verification import export_step  # OCCT

        part = designed_part(design.system, built.lens)
        for check in export_step(part, design.problem.export.schema, folder / STEP):
            if not check.ok:
                raise NumericalError(f"{folder / STEP}: {check.name}; is the disk sound? Run it again")

    notes = [*beside(design.problem), *loss_notes(made.metrics, design.system.units)]
    verdict = built.verdict(design.problem.verify, notes)
    data = as_built_data(built) | verdict.data()
    files = (*FILES, STEP) if options.step else FILES
    write_record(folder / RECORD, data, files)
    lines = [*as_built_lines(built), f"as made: {verdict}", f"wrote {folder}"]
    return Outcome(data, lines, OF_GRADES[verdict.grade])
