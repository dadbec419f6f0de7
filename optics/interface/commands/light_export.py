"""The part of `thbcad export` that writes light: the rays behind the lens, or their intensity."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Collection, Mapping, Sequence
from contextlib import closing
from math import isclose
from pathlib import Path
from typing import Any

from optics.base.runtime import Check, Phase, Progress, UserError, check_lines, verification
from optics.designing.progress import drawing
from optics.exchange.export import report_of, require_free_files
from optics.exchange.results import HASHES, ResultFolder, hashes, read_arrays
from optics.interface.commands.outcome import OF_GRADES, Outcome
from optics.light.blur import spot_rms
from optics.light.outgoing import (
    OnTarget,
    OutgoingIntensity,
    StepsOnTarget,
    outgoing_intensity,
    outgoing_rays,
)
from optics.scene.luminaires import Luminaire, luminaire_writer, read_luminaire
from optics.scene.photometry import units_of
from optics.scene.ray_files import read_rays, require_ray_suffix, write_rays
from optics.scene.system import System, require_lens_on_axis
from thbcad.checks import Floats
from thbcad.io import json_text, write_text

LIGHT = "irradiance.npz"  # of a result folder
MOST_RAYS = 1 << 25  # of a ray file: a gigabyte
STEPS = 0.5, 30.0  # degrees: from 5 MB of text to what still tells front from side
DECIMALS = 4  # of the angles in files
LUMINAIRE_SUFFIXES = (".ies", ".ldt")
DIGITS = 1e-6  # of the peak, and of the flux: files have seven digits and more


def is_luminaire(options: Namespace) -> bool:
    """Return whether an export is to write an intensity: its file has the suffix of a luminaire."""
    return Path(options.out).suffix.lower() in LUMINAIRE_SUFFIXES and options.format is None


def rays_of_light(options: Namespace) -> Outcome:
    """Write the light behind the lens of a result as a ray file, and read it back.

    Raises UserError : no result folder, another suffix, --format, or too many rays.
    """
    out = Path(options.out)
    if options.format is not None:
        raise UserError(f"the suffix of {out} says how rays are written: leave out --format")
    require_ray_suffix(out)
    require_free_files([out], options.out, options.force)
    system = traceable(options)
    rays = outgoing_rays(system, system.backend, options.rays, options.light)
    write_rays(rays, out)
    read = read_rays(out)
    differ = sum(
        float((getattr(read, name) != getattr(rays, name)).sum())
        for name in ("position", "direction", "flux")
    )
    checks = [Check("numbers of the rays that differ", differ, 0, "")]
    written = f"wrote {out}, {len(rays)} rays with {rays.total:.6g} {rays.unit} over all faces"
    data = {"rays": len(rays), units_of(rays.unit).key("flux"): rays.total}
    return reported(options.out, out.suffix[1:].lower(), [out], checks, data, [written])


def intensity_of_light(options: Namespace) -> Outcome:
    """Write the intensity of the light behind the lens of a result as a luminaire, and read it back.

    Raises UserError : no lens on the axis, no result folder, too many rays, a step out of range, or no light.
    """
    out = Path(options.out)
    require_free_files([out], options.out, options.force)
    write = luminaire_writer(out.suffix.lower())
    system = traceable(options)
    light = traced_intensity(system, options)
    write(light.luminaire, out, system.problem.title)
    read, peak = read_luminaire(out), float(light.luminaire.candela.max())
    units = system.units
    off = float(abs(read.candela - light.luminaire.candela).max()) / peak
    checks = [
        Check("intensities of the file that differ from the traced ones, of the peak", off, DIGITS, ""),
        Check(
            "flux of the file against the traced flux, relative", abs(read.flux / light.flux - 1), DIGITS, ""
        ),
    ]
    data = {
        units.key("flux"): light.flux,
        f"peak_{units.in_far_field.suffix}": peak,
        "steps_deg": list(light.steps),
        "noise": light.noise,
    }
    shown = _shown(system, read, options)
    data["on_target"] = {name: vars(one) for name, one in shown.items()}
    c, gamma = light.steps
    lines = [
        f"wrote {out}, {light.flux:.6g} {units.flux} that leave the lens by any face, "
        f"at most {peak:.4g} {units.in_far_field.shown}",
        f"steps of {c:.4g} degrees in C, {gamma:.4g} in gamma; noise {light.noise:.2%} of the intensity (L2)",
        _on_target(shown),
        *([] if system.problem.optic.array else ["the light of one lens: thbcad road --lenses counts more"]),
        "+z is gamma = 0, +x is C0" + ("; watts stand for lumens" if units.flux == "W" else ""),
    ]
    return reported(options.out, out.suffix[1:].lower(), [out], checks, data, lines)


def traceable(options: Namespace) -> System:
    """Return the system to be traced.

    Raises UserError : no result folder, or too many rays.
    """
    if not 1 <= options.rays <= MOST_RAYS:
        raise UserError(f"--rays must be from 1 to {MOST_RAYS}, got {options.rays}")
    if not Path(options.result).is_dir():
        raise UserError(f"light needs the problem of a result folder, and {options.result} is none")
    return ResultFolder(options.result).read().system


def traced_intensity(system: System, options: Namespace) -> OutgoingIntensity:
    """Return the intensity of the light that leaves a lens.

    Raises UserError : no lens on the axis, a step out of range, or no light.
    """
    step = options.step
    low, high = STEPS
    within = low <= step <= high and round(step, DECIMALS) == step
    if not within or not isclose(round(180 / step) * step, 180):
        raise UserError(
            f"--step must divide 180 degrees and be from {low:g} to {high:g}, such as 1, 2.5 or 5; "
            f"got {step:g}"
        )
    require_lens_on_axis(system, "intensities in files", "export its rays by --light rear")
    with closing(drawing(sys.stderr)) as bar:
        progress = Progress([Phase("rays through the lens", 1.0)], bar)

        def show(done: int, of: int) -> None:
            progress.advance(done / of, f"{done / of:.0%} of {options.rays:,} rays")

        light = outgoing_intensity(system, system.backend, options.rays, step, show)
        progress.finish()
    return light


def _shown(system: System, luminaire: Luminaire, options: Namespace) -> dict[str, OnTarget]:
    """Return the light on the target of the lens, of its file, and of steps alone; none without the light."""
    path = Path(options.result) / LIGHT
    if not path.exists():
        return {}
    of_lens: Floats = read_arrays(path, ("irradiance",))["irradiance"]
    blur = 0.0 if system.target.uniform_region is None else spot_rms(system, system.backend)
    beside = StepsOnTarget(system, of_lens, blur)
    finer = dict.fromkeys((options.step, max(options.step / 2, STEPS[0]), STEPS[0]))
    alone = {f"steps of {step:g} alone": beside.by_steps(step) for step in finer}
    return {"the lens": beside.own, "this file": beside.by_file(luminaire), **alone}


def _on_target(shown: Mapping[str, OnTarget]) -> str:
    """Return what the light on the target is, of the lens and as a luminaire file has it."""
    if not shown:
        return (
            f"what the steps do to the light on the target is not said: {LIGHT} is not in the result folder"
        )
    parts = []
    for name, one in shown.items():
        even = [] if one.min_over_mean is None else [f"U0 {one.min_over_mean:.2f}"]
        off = [f"{one.rel_l2:.1%} off"] if one.rel_l2 else []
        if even or off:
            parts.append(f"{name} {', '.join([*even, *off])}")
    return f"on the target (rel_l2 to the light of the lens, seen from the rear's middle): {'; '.join(parts)}"


def reported(
    out: str,
    form: str,
    files: Collection[Path],
    checks: Sequence[Check],
    numbers: dict[str, Any],
    lines: Sequence[str],
) -> Outcome:
    """Write the report beside files that were exported, and return the outcome.  form : their format."""
    report = report_of(out)
    data = {
        "format": form,
        "files": [str(file) for file in files],
        **numbers,
        **verification(checks),
        HASHES: hashes(report.parent, [file.name for file in files]),
    }
    write_text(report, json_text(data))
    return Outcome(data, [*check_lines(data), *lines], OF_GRADES[data["grade"]])
