"""`thbcad asbuilt`: the light of a lens as it was made, beside that of its design."""

from __future__ import annotations

from argparse import Namespace
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from optics.base.runtime import NumericalError
from optics.exchange.results import beside, require_own, writable_folder, write_recorded
from optics.interface.api import Design
from optics.interface.commands.outcome import OF_GRADES, Outcome
from optics.interface.screens import made_screen
from optics.light.analysis import loss_notes
from optics.scene.system import designed_part
from optics.tolerancing.metrology import FileFrame, Way, as_built_data, as_built_lines
from thbcad.io import json_text, lens_to_dict

RECORD = "asbuilt.json"
FILES = ("lens.json", "light.png", "errors.png", "irradiance.npz")
STEP = "lens.step"  # where it is asked for
TOLD = ("unit", "height_unit", "mirror", "turn", "down", "centre")  # of a FileFrame, as options are called


def asbuilt(options: Namespace) -> Outcome:
    """Measure the light of a made lens."""
    folder = Path(options.out or Path(options.result) / "asbuilt")
    design = Design.load(options.result)
    writable_folder(folder)
    require_own(folder, (*FILES, STEP, RECORD), RECORD, options.force)
    told = {name: getattr(options, name) for name in TOLD}
    frame = FileFrame(kind="errors" if options.errors else "heights", **told)
    way: Way = "best fit" if options.align == "best-fit" else "datums"
    built = design.as_built(options.measured, frame, options.surface, way)
    from optics.reporting.figures import height_error_figure, made_light_figure  # matplotlib

    made, packed = built.measurement, BytesIO()
    np.savez_compressed(packed, made=made.irradiance, designed=built.nominal.irradiance, target=made.target)
    contents = {
        "irradiance.npz": packed.getvalue(),
        "light.png": made_light_figure(built, design.system.target.screen()),
        "errors.png": height_error_figure(built),
        "lens.json": json_text(lens_to_dict(built.lens)).encode(),
    }
    if options.step:
        from optics.exchange.verification import export_step  # OCCT

        part = designed_part(design.system.with_lens(built.lens))
        with TemporaryDirectory() as staged:
            path = Path(staged) / STEP
            for check in export_step(part, design.problem.export.schema, path):
                if not check.ok:
                    raise NumericalError(f"{folder / STEP}: {check.name}; is the disk sound? Run it again")
            contents[STEP] = path.read_bytes()

    notes = [*beside(design.problem), *loss_notes(made.metrics, design.system.units)]
    verdict = built.verdict(design.problem.verify, notes)
    data = as_built_data(built) | verdict.data()
    write_recorded(folder, RECORD, data, contents, {STEP} - contents.keys())
    lines = [*as_built_lines(built), f"as made: {verdict}", f"wrote {folder}"]
    screen = made_screen(built, verdict, folder)
    return Outcome(data, lines, OF_GRADES[verdict.grade], screen)
