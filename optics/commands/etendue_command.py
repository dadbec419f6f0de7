"""`thbcad etendue`: what light the source of a problem can make at all, before any lens is shaped."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from optics.etendue import KIND, Found, certain_bound, problem_bound, rear_area, throughput
from optics.optimisation import ResultFolder, require_writable
from optics.problem import load_problem
from optics.runtime import UserError
from optics.system import solvable_system
from optics.tracing import efficiency_bound

if TYPE_CHECKING:
    from optics.etendue import Throughput
    from optics.problem import Problem
    from optics.system import OpticalSystem

NARROW = 0.05  # of a designed lens's light comes in narrower images than the width that is told
NO_LIMIT = "the source has no extent: its etendue is 0 and sets no limit to the light"


def etendue(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Tell what can arrive at the target, and how near light that is made of images of the source comes to
    it."""
    if options.efficiency is not None and not 0 < options.efficiency <= 1:
        raise UserError(f"--efficiency must be greater than 0 and at most 1, got {options.efficiency:g}")
    if options.out:
        require_writable(Path(options.out))
    system = solvable_system(load_problem(options.problem))
    problem, lens, found = system.problem, system.lens, throughput(system)
    data, lines = _throughput_told(problem, found)
    if not found.source:
        return data, [*lines, NO_LIMIT], True
    share = options.efficiency or found.picture / problem.source.flux
    start = perf_counter()
    bound = certain_bound(system, lens, share)
    told = _told(bound, start)
    data |= {"efficiency": share, "bound": told}
    lines += _bound_lines(system, told)
    lines.append(
        f"no {KIND}, {rear_area(lens):.4g} mm^2, brings {share:.4g} of the light to the target and goes "
        "below that"
    )
    lines.append("lenses whose images differ may: etendue bounds the mean of their areas alone")
    if options.measure:
        start = perf_counter()
        data["measured"] = _told(problem_bound(system, _measured_half_width(system, options.measure)), start)
        lines.append(
            f"the lens of {options.measure}: {1 - NARROW:.0%} of its light comes in images at least so "
            "large; were they alike:"
        )
        lines += _bound_lines(system, data["measured"])
    if options.out:
        from optics.report import bound_figure
        from thbcad.io import write_bytes

        write_bytes(Path(options.out), bound_figure(bound.bound, system.target.screen()))
        lines.append(f"wrote {options.out}")
    return data, lines, True


def _told(found: Found, start: float) -> dict[str, Any]:
    bound = found.bound
    return {
        "half_width": list(found.half_width),
        "pixels": list(found.width),
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


def _throughput_told(problem: Problem, found: Throughput) -> tuple[dict[str, Any], list[str]]:
    passing = efficiency_bound(problem.lens.index)
    data: dict[str, Any] = {
        "etendue_mm2_sr": {"source": found.source, "front": found.front, "target": found.target},
        "flux_w": {
            "source": problem.source.flux,
            "meets_front": found.meets_front,
            "arriving": found.arriving,
            "picture": found.picture,
        },
        "brightness_asked": found.asked,
    }
    lines = [
        f"{found.source:10.4g} mm^2 sr  etendue of the source",
        f"{found.front:10.4g} mm^2 sr  of its light that meets the front",
        f"{found.target:10.4g} mm^2 sr  between rear aperture and target",
        f"{found.meets_front:10.4g} W  meet the front; two uncoated faces pass at most {passing:.4f}",
        f"{found.arriving:10.4g} W  can arrive at most",
    ]
    if found.source:
        lines.append(
            f"{found.picture:10.4g} W  as the picture asked for, whose brightest pixel then takes "
            f"{found.asked:.3g} of the radiance"
        )
    return data, lines


def _bound_lines(system: OpticalSystem, told: dict[str, Any]) -> list[str]:
    unit = "degrees" if system.target.far_field else "mm"
    (hx, hy), (wide, high) = told["half_width"], told["pixels"]
    lines = [
        f"images of the source: at least {2 * hx:.4g} x {2 * hy:.4g} {unit}, {wide:.3g} x {high:.3g} pixels"
    ]
    if not told["sizes"]:
        return [*lines, "they are narrower than two pixels and set no limit to rel_l2"]
    if system.problem.source.profile != "uniform":
        lines.append(
            "note: the source is no uniform rectangle; the bound holds for images of this size, centred on "
            "pixels"
        )
    return [
        *lines,
        f"rel_l2 is at least {told['lower_bound']:.4f}; light with {told['attained']:.4f} was found "
        f"(KKT {told['kkt']:.1e}, {told['merged']} x {told['merged']} pixels merged, {told['sizes']} sizes, "
        f"{told['seconds']:.1f} s)",
    ]
