"""`thbcad relight`: a finished design in other light, beside its own."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from optics.base.runtime import check_lines, verification
from optics.interface.api import Design
from optics.interface.commands.outcome import OF_GRADES, Outcome, number_text
from optics.interface.commands.problem_options import picture_path
from optics.interface.relighting import other_source
from optics.light.analysis import loss_notes
from optics.scene.photometry import units_of
from thbcad.io import write_bytes

SHOWN = ("rel_l2_debiased", "psnr_db", "ssim", "efficiency", "lit_efficiency", "stray")


def relight(options: Namespace) -> Outcome:
    """Measure the lens of a result folder in other light."""
    out = picture_path(options)
    design = Design.load(options.result)
    light = other_source(options.source, design.problem)
    own, other = design.measurement, design.relight(light)
    notes = loss_notes(other.metrics, units_of(light.unit))  # another file's light has its own unit
    verdict = other.verdict(design.problem.verify, notes)
    data = {
        "designed": _numbers(own.metrics) | design.verdict.data(),
        "relit": _numbers(other.metrics) | verdict.data(),
    }
    lines = [f"{'':15} {'as designed':>12} {options.source:>12}"]
    for key in SHOWN:
        words = [number_text(numbers[key], ".4f") for numbers in data.values()]
        lines.append(f"{key:15} {words[0]:>12} {words[1]:>12}")
    if out:
        from optics.reporting.figures import relit_figure  # matplotlib

        write_bytes(out, relit_figure(own, other, design.system.target.screen(), options.source))
        lines.append(f"wrote {out}")
    lines += [*check_lines(verification(verdict.checks)), *(f"note: {note}" for note in notes)]
    return Outcome(data, [*lines, f"{options.source}: {verdict}"], OF_GRADES[verdict.grade])


def _numbers(metrics: dict[str, Any]) -> dict[str, float | None]:
    """Return the metrics that are shown, None for one that is not defined."""
    return {key: metrics[key] for key in SHOWN}
