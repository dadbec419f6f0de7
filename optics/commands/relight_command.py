"""`thbcad relight`: a finished design in other light, beside its own."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from optics.api import Design
from optics.commands.outcome import Outcome
from optics.commands.picture_file import picture_path

SHOWN = ("rel_l2", "psnr_db", "ssim", "efficiency", "stray")


def relight(options: Namespace) -> Outcome:
    """Measure the lens of a result folder in other light."""
    out = picture_path(options)
    design = Design.load(options.result)
    own, other = design.measurement, design.relight(options.source)
    data = {"designed": _numbers(own.metrics), "relit": _numbers(other.metrics)}
    lines = [f"{'':12} {'as designed':>12} {options.source:>12}"]
    lines += [f"{key:12} {data['designed'][key]:12.4f} {data['relit'][key]:12.4f}" for key in SHOWN]
    if out:
        from optics.figures import relit_figure
        from thbcad.io import write_bytes

        write_bytes(out, relit_figure(own, other, design.system.target.screen(), options.source))
        lines.append(f"wrote {out}")
    return Outcome(data, lines)


def _numbers(metrics: dict[str, Any]) -> dict[str, float]:
    return {key: float(metrics[key]) for key in SHOWN}
