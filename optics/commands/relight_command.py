"""`thbcad relight`: a finished design in other light, beside its own."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from optics.commands.outcome import Outcome
from optics.relighting import other_source, relit
from optics.results import ResultFolder, require_own, require_writable
from optics.runtime import UserError
from optics.system import OpticalSystem

SHOWN = ("rel_l2", "psnr_db", "ssim", "efficiency", "stray")


def relight(options: Namespace) -> Outcome:
    """Measure the lens of a result folder in other light."""
    if options.out:
        out = Path(options.out)
        if out.suffix.lower() != ".png":
            raise UserError(f"--out must end in .png, since the picture is a PNG, got {out}")
        require_writable(out)
        require_own(out.parent, (out.name,), "", options.force)
    problem, lens, _ = ResultFolder(options.result).read()
    source = other_source(options.source, problem)
    from optics.runtime import load_backend

    backend = load_backend("double", problem.run.threads)
    own = relit(problem, lens, problem.source, backend)
    other = relit(problem, lens, source, backend)
    data = {"designed": _numbers(own.metrics), "relit": _numbers(other.metrics)}
    lines = [f"{'':12} {'as designed':>12} {options.source:>12}"]
    lines += [f"{key:12} {data['designed'][key]:12.4f} {data['relit'][key]:12.4f}" for key in SHOWN]
    if options.out:
        from optics.report import relit_figure
        from thbcad.io import write_bytes

        write_bytes(out, relit_figure(own, other, OpticalSystem(problem).target.screen(), options.source))
        lines.append(f"wrote {out}")
    return Outcome(data, lines)


def _numbers(metrics: dict[str, Any]) -> dict[str, float]:
    return {key: float(metrics[key]) for key in SHOWN}
