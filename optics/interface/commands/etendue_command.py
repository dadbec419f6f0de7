"""`thbcad etendue`: what light the source of a problem can make at all, before any lens is shaped."""

from __future__ import annotations

from argparse import Namespace
from math import prod, sqrt
from time import perf_counter
from typing import Any

from optics.base.runtime import UserError
from optics.designing.etendue import (
    FIXED,
    SEARCH,
    UNBOUND,
    ImageBound,
    OneBlur,
    Throughput,
    base_rear,
    blur_sentence,
    bounds_hold,
    curve_sentence,
    greatest_slack,
    images_bound,
    one_blur,
    one_blur_sentence,
    one_blur_tells,
    stretchable,
    throughput,
    universal_bound,
    universal_lines,
    universal_sentence,
    usual_efficiency,
)
from optics.exchange.results import ResultFolder
from optics.interface.commands.outcome import Outcome
from optics.interface.commands.problem_options import picture_path, system_of
from optics.interface.screens import etendue_screen
from optics.light.analysis import passing_share, passing_words
from optics.light.blur import patch_images
from optics.scene.system import System
from thbcad.io import write_bytes

NARROW = 0.05  # of a designed lens's light comes in smaller images than the measured area
NO_LIMIT = "the source has no extent: its etendue is 0 and sets no limit to the light"
OFF_AXIS = (
    "one blur everywhere is a model of one source and a lens on the axis before a target across it, and of "
    "no other"
)
SEVERAL = "there are several sources: etendue bounds the light of one, so that no limit is given"
OF_SOURCE = 2  # lines on the source's own etendue, the first ones
UNKNOWN = "a file describes the source: its etendue is not known, so that no limit is given"


def etendue(options: Namespace) -> Outcome:
    """Say what etendue forbids every lens of a problem, and what one blur everywhere would cost."""
    if options.efficiency is not None and not 0 < options.efficiency <= 1:
        raise UserError(f"--efficiency must be greater than 0 and at most 1, got {options.efficiency:g}")
    out = picture_path(options)
    system = system_of(options)
    if system.problem.optic.automatic:
        from optics.designing.prediction import resolved  # few problems ask

        system, _ = resolved(system, system.backend)
    passing = throughput(system)
    data: dict[str, Any] = {
        "etendue_mm2_sr": {"source": passing.source, "front": passing.front, "target": passing.target},
        system.units.key("flux"): {"source": system.problem.flux, "meets_front": passing.meets_front},
    }
    lines = _throughput_lines(system, passing)
    without = _why_no_limit(system, passing)
    for name in ("measure", "out"):
        if getattr(options, name) and (without or not one_blur_tells(system)):
            raise UserError(f"{without or OFF_AXIS}; leave out --{name}")
    if without:
        return Outcome(data, [*lines, without], screen=etendue_screen(system, data, without, 0.0, None))
    universal = universal_bound(system)
    efficiency = options.efficiency or usual_efficiency(system, universal)
    cap = greatest_slack(system, universal.most / passing.radiance)
    lines += [
        universal_sentence(system, universal, efficiency),
        *universal_lines(system, universal),
        curve_sentence(system, universal),
        "each pixel is taken to see a little more than the whole envelope, never less: "
        f"by dense sampling {cap:.4f} times its etendue at most",
    ]
    data |= {
        "efficiency": efficiency,
        "universal": {
            "rel_l2": universal.least_rel_l2(efficiency),
            "exact_efficiency": universal.exact_efficiency,
            system.units.key("on_target"): universal.most_on_target,
            system.units.key("on_lit"): universal.most_on_lit,
            "peak": universal.peak,
            "curve": [list(point) for point in universal.curve()],
            "cap_over_sampled": cap,
        },
    }
    if not one_blur_tells(system):
        return Outcome(data, [*lines, OFF_AXIS], screen=etendue_screen(system, data, "", efficiency, None))
    data["one_blur"], alike, more = _one_blurs(system, efficiency)
    lines += more
    if options.measure:
        data["measured"], more = _measured(system, options.measure)
        lines += more
    if out:
        from optics.reporting.figures import bound_figure  # matplotlib

        write_bytes(out, bound_figure(universal, alike, system.target.screen()))
        lines.append(f"wrote {out}")
    return Outcome(data, lines, screen=etendue_screen(system, data, "", efficiency, out))


def _why_no_limit(system: System, passing: Throughput) -> str:
    """Return why etendue gives no limit to the light of a source, "" where it gives one."""
    if system.source.several:
        return SEVERAL
    if system.source.by_rays:
        return UNKNOWN
    if not passing.source:
        return NO_LIMIT
    return "" if bounds_hold(system) else UNBOUND


def _one_blurs(system: System, efficiency: float) -> tuple[dict[str, Any], ImageBound, list[str]]:
    """Return the bounds of one blur for --json, that of the source's proportions, and lines."""
    start = perf_counter()
    alike = one_blur(system.unshaped, efficiency, FIXED, any_form=False)
    blurs = {"source_proportions": _blur_data(alike, start)}
    lines = [
        f"{one_blur_sentence(system)}, {base_rear(system)}",
        *_blur_lines(system, alike, blurs["source_proportions"], False),
    ]
    if stretchable(system):
        start = perf_counter()
        free = one_blur(system.unshaped, efficiency, SEARCH)
        blurs["any_proportions"] = _blur_data(free, start)
        lines += _blur_lines(system, free, blurs["any_proportions"], True)
    return blurs, alike.bound, lines


def _blur_data(images: OneBlur, start: float) -> dict[str, Any]:
    """Return a bound for --json.  start : `perf_counter()` before it was computed."""
    bound = images.bound
    return {
        "area": 4 * prod(images.half_width) * images.filled,
        "square_pixels": prod(images.width) * images.filled,
        "lower_bound": bound.lower_bound,
        "attained": bound.attained,
        "kkt": bound.kkt,
        "merged": bound.merged,
        "sizes": bound.sizes,
        "seconds": perf_counter() - start,
    }


def _measured(system: System, result: str) -> tuple[dict[str, Any], list[str]]:
    """Return the bound for images as a designed lens projects them, for --json and as lines."""
    start = perf_counter()
    designed = system.with_lens(ResultFolder(result).read_lens())
    half = sqrt(patch_images(designed, system.backend).smallest(NARROW)) / 2
    images = images_bound(system, (half, half), SEARCH)
    data = _blur_data(images, start)
    return data, [
        f"the lens of {result}: "
        f"{1 - NARROW:.0%} of its light comes in images at least so large; were they alike:",
        *_blur_lines(system, images, data, True),
    ]


def _throughput_lines(system: System, passing: Throughput) -> list[str]:
    met, unit = system.problem.faces_met, system.units.flux
    passing_on = passing_words(passing_share(system.unshaped.path))
    first = f"the {met[0].face} of the base lens" if system.problem.lens else met[0].name
    lines = [
        f"{passing.source:10.4g} mm^2 sr  etendue of the source",
        f"{passing.front:10.4g} mm^2 sr  of its light that meets {first}",
        *(f"{u:10.4g} mm^2 sr  between rear aperture and target" for u in [passing.target] if u is not None),
        f"{passing.meets_front:10.4g} {unit}  meet {first}; {passing_on}",
    ]
    return lines[OF_SOURCE:] if system.source.by_rays else lines


def _blur_lines(system: System, images: OneBlur, data: dict[str, Any], any_form: bool) -> list[str]:
    unit = system.target.receiver.area_unit
    lines = [f"images of the source: at least {data['area']:.4g} {unit}"]
    if any_form:
        lines = []
    elif system.problem.source.profile != "uniform":
        lines.append(
            "note: the source is no uniform rectangle; "
            "the bound holds for images of this size in its own proportions, centred on pixels"
        )
    if not data["sizes"]:
        return [*lines, "such images are narrower than two pixels and set no limit to rel_l2"]
    return [
        *lines,
        f"{blur_sentence(images, any_form)}; the solver attains {data['attained']:.4f} "
        f"(KKT {data['kkt']:.1e}, {data['merged']} x {data['merged']} pixels merged, "
        f"{data['sizes']} sizes, {data['seconds']:.1f} s)",
    ]
