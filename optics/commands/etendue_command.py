"""`thbcad etendue`: what light the source of a problem can make at all, before any lens is shaped."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from optics.etendue import ImageBound, image_bound, image_half_width, rear_area, throughput
from optics.optimisation import ResultFolder, require_writable
from optics.problem import load_problem
from optics.runtime import UserError
from optics.system import base_lens, sound, source_profile, target_irradiance, target_screen
from optics.tracing import efficiency_bound

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from optics.etendue import Throughput
    from optics.problem import Problem
    from thbcad.lens import Lens

LEAST_PIXELS = 4  # each way, that merging leaves
NARROW = 0.05  # of a designed lens's light comes in narrower images than the width that is told
NO_LIMIT = "the source has no extent: its etendue is 0 and sets no limit to the light"
KIND = "lens that throws the same even image of the source, with sides along x and y, through every point of a rear as large"


@dataclass(frozen=True)
class Care:
    """How sharp a bound is made: with images of at most `widest` merged pixels, on at most `pixels` merged pixels each way."""

    widest: float
    pixels: float


FULL = Care(12.0, float("inf"))
NEAR = (0.25, 1.0)  # rel_l2 of lenses that a bound is asked for; the second where the first is out of reach
REPORT = Care(8.0, 256.0)  # some seconds
QUICK = Care(5.0, 128.0)  # a second or two: for notes beside other work


@dataclass(frozen=True, eq=False)
class Found:
    """A bound for images of a half-width in mm (degrees in the far field), their width in pixels."""

    half_width: tuple[float, float]
    width: tuple[float, float]
    bound: ImageBound


def etendue(options: Namespace) -> tuple[dict[str, Any], list[str], bool]:
    """Tell what can arrive at the target, and how near light that is made of images of the source comes to it."""
    if options.efficiency is not None and not 0 < options.efficiency <= 1:
        raise UserError(f"--efficiency must be greater than 0 and at most 1, got {options.efficiency:g}")
    if options.out:
        require_writable(Path(options.out))
    problem = load_problem(options.problem)
    light, lens = sound(problem)
    found = throughput(problem, lens, light)
    data, lines = _throughput_told(problem, found)
    if not found.source:
        return data, [*lines, NO_LIMIT], True
    share = options.efficiency or found.picture / problem.source.flux
    start = perf_counter()
    bound = certain_bound(problem, lens, light, share)
    told = _told(bound, start)
    data |= {"efficiency": share, "bound": told}
    lines += _bound_lines(problem, told)
    lines.append(f"no {KIND}, {rear_area(lens):.4g} mm^2, brings {share:.4g} of the light to the target and goes below that")
    lines.append("lenses whose images differ may: etendue bounds the mean of their areas alone")
    if options.measure:
        start = perf_counter()
        data["measured"] = _told(problem_bound(problem, light, _measured_half_width(problem, options.measure)), start)
        lines.append(f"the lens of {options.measure}: {1 - NARROW:.0%} of its light comes in images at least so large; were they alike:")
        lines += _bound_lines(problem, data["measured"])
    if options.out:
        from optics.report import bound_figure
        from thbcad.io import write_bytes

        write_bytes(Path(options.out), bound_figure(bound.bound, target_screen(problem)))
        lines.append(f"wrote {options.out}")
    return data, lines, True


def etendue_note(problem: Problem, light: NDArray[np.float64]) -> list[str]:
    """Return what etendue says about a problem, for `thbcad check`; nothing for sources without extent."""
    if problem.source.kind != "lambertian":
        return []
    lens = base_lens(problem)
    found = throughput(problem, lens, light)
    share = found.picture / problem.source.flux
    sentences = []
    if found.asked > 1:
        sentences.append(
            f"the brightest pixel asked for needs {found.asked:.3g} times the radiance of the source; "
            f"at most {found.picture:.4g} W can make this picture"
        )
    images = certain_bound(problem, lens, light, share, QUICK)
    wide, high = images.width
    sentences.append(
        f"images of the source are at least {wide:.2g} x {high:.2g} pixels: no {KIND} brings {share:.3g} of the light to the target "
        f"with rel_l2 below {images.bound.lower_bound:.3f}"
    )
    return sentences


def limit_sentence(problem: Problem, lens: Lens, light: NDArray[np.float64], metrics: dict[str, Any]) -> str | None:
    """Return what etendue says about a finished design, by its rel_l2 and efficiency; None where it sets no limit."""
    share = metrics["efficiency"]
    if problem.source.kind != "lambertian" or not share:
        return None
    reached = metrics["rel_l2"]
    bound = problem_bound(problem, light, image_half_width(problem, lens, share, light, reached), REPORT).bound
    limit = f"no {KIND} brings as much light to the target and goes below {min(reached, bound.lower_bound):.4f}"
    return f"rel_l2 reached {reached:.4f}; by etendue {limit}"


def certain_bound(problem: Problem, lens: Lens, light: NDArray[np.float64], share: float, care: Care = FULL) -> Found:
    """Return the Found bound for lenses of the kind, with a rear of this lens's area, that bring a share of the flux to the target.

    Light nearer to the target comes in larger images.  Lenses worse than rel_l2 = e need no other bound than e; the images of
    the others are at least as large as those that belong to e.  With the bound b for these, min(e, b) holds for all.
    """
    for error in NEAR:
        found = problem_bound(problem, light, image_half_width(problem, lens, share, light, error), care)
        if found.bound.lower_bound <= error:
            break
    return replace(found, bound=replace(found.bound, lower_bound=min(error, found.bound.lower_bound)))


def problem_bound(problem: Problem, light: NDArray[np.float64], half_width: tuple[float, float], care: Care = FULL) -> Found:
    """Return the Found bound of a problem's target for images of the source at least so large.

    In the far field pictures are intensities; d Omega / (du dv) is taken as constant over an image of the source.

    half_width : of the images, mm (degrees in the far field).
    """
    screen = target_screen(problem)
    target = target_irradiance(light, screen, problem.target.placing, 1.0) / screen.projection()
    width = tuple(2 * h / p for h, p in zip(half_width, screen.pitch))
    wanted = max(1, ceil(max(width) / care.widest), ceil(max(screen.pixels) / care.pixels))
    merge = max(1, min(wanted, min(screen.pixels) // LEAST_PIXELS))
    return Found(half_width, width, image_bound(target, width, source_profile(problem), merge))


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


def _measured_half_width(problem: Problem, result: str) -> tuple[float, float]:
    """Return half the width and height of the narrow images that a designed lens throws."""
    from optics.etendue import patch_images
    from optics.runtime import load_backend

    lens = ResultFolder(result).read_lens()
    wide, high = patch_images(load_backend("double", problem.run.threads), problem, lens).narrowest(NARROW)
    return wide / 2, high / 2


def _throughput_told(problem: Problem, found: Throughput) -> tuple[dict[str, Any], list[str]]:
    passing = efficiency_bound(problem.lens.index)
    data: dict[str, Any] = {
        "etendue_mm2_sr": {"source": found.source, "front": found.front, "target": found.target},
        "flux_w": {"source": problem.source.flux, "meets_front": found.meets_front, "arriving": found.arriving, "picture": found.picture},
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
            f"{found.picture:10.4g} W  as the picture asked for, whose brightest pixel then takes {found.asked:.3g} of the radiance"
        )
    return data, lines


def _bound_lines(problem: Problem, told: dict[str, Any]) -> list[str]:
    unit = "degrees" if target_screen(problem).angular else "mm"
    (hx, hy), (wide, high) = told["half_width"], told["pixels"]
    lines = [f"images of the source: at least {2 * hx:.4g} x {2 * hy:.4g} {unit}, {wide:.3g} x {high:.3g} pixels"]
    if not told["sizes"]:
        return [*lines, "they are narrower than two pixels and set no limit to rel_l2"]
    if problem.source.profile != "uniform":
        lines.append("note: the source is no uniform rectangle; the bound holds for images of this size, centred on pixels")
    return [
        *lines,
        f"rel_l2 is at least {told['lower_bound']:.4f}; light with {told['attained']:.4f} was found "
        f"(KKT {told['kkt']:.1e}, {told['merged']} x {told['merged']} pixels merged, {told['sizes']} sizes, {told['seconds']:.1f} s)",
    ]
