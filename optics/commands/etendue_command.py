"""`thbcad etendue`: what light the source of a problem can make at all, before any lens is shaped."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from optics.commands.outcome import Outcome
from optics.commands.problem_options import system_of
from optics.etendue import LENS_CLASS, ProblemBound, certain_bound, problem_bound, rear_area, throughput
from optics.results import ResultFolder, require_own, require_writable
from optics.runtime import UserError
from optics.tracing import normal_incidence_transmittance

if TYPE_CHECKING:
    from optics.etendue import Throughput
    from optics.system import OpticalSystem

NARROW = 0.05  # of a designed lens's light comes in narrower images than the measured width
NO_LIMIT = "the source has no extent: its etendue is 0 and sets no limit to the light"


def etendue(options: Namespace) -> Outcome:
    """Say what can arrive at the target, and how near light made of images of the source comes to it."""
    if options.efficiency is not None and not 0 < options.efficiency <= 1:
        raise UserError(f"--efficiency must be greater than 0 and at most 1, got {options.efficiency:g}")
    if options.out:
        out = Path(options.out)
        if out.suffix.lower() != ".png":
            raise UserError(f"--out must end in .png, since the picture is a PNG, got {out}")
        require_writable(out)
        require_own(out.parent, (out.name,), "", options.force)
    system = _resolved_base(system_of(options))
    passing = throughput(system)
    data, lines = _throughput_data(system, passing), _throughput_lines(system, passing)
    if not passing.source:
        return Outcome(data, [*lines, NO_LIMIT])
    efficiency = options.efficiency or passing.picture / system.problem.source.flux
    start = perf_counter()
    bound = certain_bound(system, system.lens, efficiency)
    data |= {"efficiency": efficiency, "bound": _bound_data(bound, start)}
    lines += [
        *_bound_lines(system, data["bound"]),
        f"no {LENS_CLASS}, {rear_area(system.lens):.4g} mm^2, "
        f"brings {efficiency:.4g} of the light to the target and goes below that",
        "lenses whose images differ may: etendue bounds the mean of their areas alone",
    ]
    if options.measure:
        start = perf_counter()
        measured = problem_bound(system, _measured_half_width(system, options.measure))
        data["measured"] = _bound_data(measured, start)
        lines += [
            f"the lens of {options.measure}: "
            f"{1 - NARROW:.0%} of its light comes in images at least so large; were they alike:",
            *_bound_lines(system, data["measured"]),
        ]
    if options.out:
        from optics.report import bound_figure
        from thbcad.io import write_bytes

        write_bytes(Path(options.out), bound_figure(bound.bound, system.target.screen()))
        lines.append(f"wrote {options.out}")
    return Outcome(data, lines)


def _bound_data(images: ProblemBound, start: float) -> dict[str, Any]:
    """Return a bound for --json.  start : `perf_counter()` before it was computed."""
    bound = images.bound
    return {
        "half_width": list(images.half_width),
        "pixels": list(images.width),
        "lower_bound": bound.lower_bound,
        "attained": bound.attained,
        "kkt": bound.kkt,
        "merged": bound.merged,
        "sizes": bound.sizes,
        "seconds": perf_counter() - start,
    }


def _measured_half_width(system: OpticalSystem, result: str) -> tuple[float, float]:
    """Return half the width and height of the narrow images that a designed lens throws."""
    from optics.etendue import patch_images
    from optics.runtime import load_backend

    lens = ResultFolder(result).read_lens()
    backend = load_backend("double", system.problem.run.threads)
    wide, high = patch_images(system, lens, backend).narrowest(NARROW)
    return wide / 2, high / 2


def _resolved_base(system: OpticalSystem) -> OpticalSystem:
    """Return the system with numbers for a base lens that is left to the program."""
    if not system.problem.lens.automatic:
        return system
    from optics.prediction import resolved
    from optics.runtime import load_backend

    return resolved(system, load_backend("double", system.problem.run.threads))[0]


def _throughput_data(system: OpticalSystem, passing: Throughput) -> dict[str, Any]:
    return {
        "etendue_mm2_sr": {"source": passing.source, "front": passing.front, "target": passing.target},
        "flux_w": {
            "source": system.problem.source.flux,
            "meets_front": passing.meets_front,
            "arriving": passing.arriving,
            "picture": passing.picture,
        },
        "brightness_asked": passing.asked,
    }


def _throughput_lines(system: OpticalSystem, passing: Throughput) -> list[str]:
    transmittance = normal_incidence_transmittance(system.lens.index)
    lines = [
        f"{passing.source:10.4g} mm^2 sr  etendue of the source",
        f"{passing.front:10.4g} mm^2 sr  of its light that meets the front",
        f"{passing.target:10.4g} mm^2 sr  between rear aperture and target",
        f"{passing.meets_front:10.4g} W  meet the front",
        f"{transmittance:10.4f}    of them pass two uncoated faces at normal incidence, once",
        f"{passing.arriving:10.4g} W  can arrive at most where the lens passes no more than that",
    ]
    if passing.source:
        lines.append(
            f"{passing.picture:10.4g} W  as the picture asked for, "
            f"whose brightest pixel then takes {passing.asked:.3g} of the radiance"
        )
    return lines


def _bound_lines(system: OpticalSystem, bound: dict[str, Any]) -> list[str]:
    unit = "degrees" if system.target.far_field else "mm"
    (hx, hy), (wide, high) = bound["half_width"], bound["pixels"]
    lines = [
        f"images of the source: at least {2 * hx:.4g} x {2 * hy:.4g} {unit}, {wide:.3g} x {high:.3g} pixels"
    ]
    if not bound["sizes"]:
        return [*lines, "they are narrower than two pixels and set no limit to rel_l2"]
    if system.problem.source.profile != "uniform":
        lines.append(
            "note: the source is no uniform rectangle; "
            "the bound holds for images of this size, centred on pixels"
        )
    return [
        *lines,
        f"rel_l2 is at least {bound['lower_bound']:.4f}; the solver attains {bound['attained']:.4f} "
        f"(KKT {bound['kkt']:.1e}, {bound['merged']} x {bound['merged']} pixels merged, "
        f"{bound['sizes']} sizes, {bound['seconds']:.1f} s)",
    ]
