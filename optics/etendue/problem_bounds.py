"""What etendue forbids a problem: bounds of rel_l2 for light that is made of images of the source, in numbers
and sentences."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from typing import TYPE_CHECKING, Any

from optics.etendue.source_image_bound import ImageBound, image_bound
from optics.etendue.throughput_bound import image_half_width, throughput

if TYPE_CHECKING:
    from optics.system import OpticalSystem
    from thbcad.lens import Lens

LEAST_PIXELS = 4  # each way, that merging leaves
KIND = (
    "lens that throws the same even image of the source, with sides along x and y, through every point "
    "of a rear as large"
)


@dataclass(frozen=True)
class Care:
    """How sharp a bound is made: with images of at most `widest` merged pixels, on at most `pixels` merged
    pixels each way."""

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


def etendue_note(system: OpticalSystem) -> list[str]:
    """Return what etendue says about a problem, for `thbcad check`; nothing for sources without extent."""
    source = system.problem.source
    if source.kind != "lambertian":
        return []
    found = throughput(system)
    share = found.picture / source.flux
    sentences = []
    if found.asked > 1:
        sentences.append(
            f"the brightest pixel asked for needs {found.asked:.3g} times the radiance of the source; "
            f"at most {found.picture:.4g} W can make this picture"
        )
    images = certain_bound(system, system.lens, share, QUICK)
    wide, high = images.width
    sentences.append(
        f"images of the source are at least {wide:.2g} x {high:.2g} pixels: no {KIND} brings {share:.3g} of "
        "the light to the target "
        f"with rel_l2 below {images.bound.lower_bound:.3f}"
    )
    return sentences


def limit_sentence(system: OpticalSystem, lens: Lens, metrics: dict[str, Any]) -> str | None:
    """Return what etendue says about a finished design, by its rel_l2 and efficiency; None where it sets no
    limit."""
    share = metrics["efficiency"]
    if system.problem.source.kind != "lambertian" or not share:
        return None
    reached = metrics["rel_l2"]
    bound = problem_bound(system, image_half_width(system, lens, share, reached), REPORT).bound
    limit = (
        f"no {KIND} brings as much light to the target and goes below {min(reached, bound.lower_bound):.4f}"
    )
    return f"rel_l2 reached {reached:.4f}; by etendue {limit}"


def certain_bound(system: OpticalSystem, lens: Lens, share: float, care: Care = FULL) -> Found:
    """Return the Found bound for lenses of the kind, with a rear of this lens's area, that bring a share of
    the flux to the target.

    Light nearer to the target comes in larger images.  Lenses worse than rel_l2 = e need no other bound than
    e; the images of the others are at least as large as those that belong to e.  With the bound b for these,
    min(e, b) holds for all.
    """
    for error in NEAR:
        found = problem_bound(system, image_half_width(system, lens, share, error), care)
        if found.bound.lower_bound <= error:
            break
    return replace(found, bound=replace(found.bound, lower_bound=min(error, found.bound.lower_bound)))


def problem_bound(system: OpticalSystem, half_width: tuple[float, float], care: Care = FULL) -> Found:
    """Return the Found bound of a problem's target for images of the source at least so large.

    In the far field pictures are intensities; d Omega / (du dv) is taken as constant over an image of the
    source.

    half_width : of the images, mm (degrees in the far field).
    """
    screen = system.target.screen()
    target = system.target.irradiance(screen, 1.0) / screen.projection()
    width = tuple(2 * h / p for h, p in zip(half_width, screen.pitch))
    wanted = max(1, ceil(max(width) / care.widest), ceil(max(screen.pixels) / care.pixels))
    merge = max(1, min(wanted, min(screen.pixels) // LEAST_PIXELS))
    return Found(half_width, width, image_bound(target, width, system.source.profile, merge))
