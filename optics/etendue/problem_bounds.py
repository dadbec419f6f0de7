"""What etendue forbids a problem: bounds of rel_l2 for light made of images of the source."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from typing import TYPE_CHECKING, Any

from optics.etendue.image_size import image_half_width
from optics.etendue.source_image_bound import ImageBound, image_bound
from optics.etendue.throughput_bound import throughput

if TYPE_CHECKING:
    from optics.system import OpticalSystem
    from thbcad.lens import Lens

LEAST_PIXELS = 4  # in each direction, that merging leaves
# the lenses that a bound holds for
LENS_CLASS = (
    "lens that throws the same uniform image of the source, with sides along x and y, "
    "through every point of a rear as large"
)


@dataclass(frozen=True)
class Care:
    """How sharp a bound is made.

    widest : merged pixels across an image, at most
    pixels : merged pixels in each direction of the target, at most
    """

    widest: float
    pixels: float


FULL = Care(12.0, float("inf"))
# rel_l2 of the lenses that a bound is made for; the second where no lens attains the first
NEAR = (0.25, 1.0)
REPORT = Care(8.0, 256.0)  # some seconds
QUICK = Care(5.0, 128.0)  # a second or two: for notes beside other work


@dataclass(frozen=True, eq=False)
class ProblemBound:
    """A bound of rel_l2 for images of the source.

    half_width : of the images, mm (degrees in the far field)
    width : of the images, pixels
    """

    half_width: tuple[float, float]
    width: tuple[float, float]
    bound: ImageBound


def etendue_note(system: OpticalSystem) -> list[str]:
    """Return sentences on what etendue says about a problem; none for sources without extent."""
    source = system.problem.source
    if source.kind != "lambertian":
        return []
    passing = throughput(system)
    efficiency = passing.picture / source.flux
    sentences = []
    if passing.asked > 1:
        sentences.append(
            f"the brightest pixel asked for needs {passing.asked:.3g} times the radiance of the source; "
            f"at most {passing.picture:.4g} W can make this picture"
        )
    images = certain_bound(system, system.lens, efficiency, QUICK)
    wide, high = images.width
    sentences.append(
        f"images of the source are at least {wide:.2g} x {high:.2g} pixels: "
        f"no {LENS_CLASS} brings {efficiency:.3g} of the light to the target "
        f"with rel_l2 below {images.bound.lower_bound:.3f}"
    )
    return sentences


def limit_sentence(system: OpticalSystem, lens: Lens, metrics: dict[str, Any]) -> str | None:
    """Return a sentence on what etendue says about a finished design; None where it sets no limit.

    metrics : rel_l2 and efficiency of the design
    """
    efficiency, rel_l2 = metrics["efficiency"], metrics["rel_l2"]
    if system.problem.source.kind != "lambertian" or not efficiency:
        return None
    bound = problem_bound(system, image_half_width(system, lens, efficiency, rel_l2), REPORT).bound
    return (
        f"rel_l2 reached {rel_l2:.4f}; by etendue no {LENS_CLASS} brings as much light to the target "
        f"and goes below {min(rel_l2, bound.lower_bound):.4f}"
    )


def certain_bound(system: OpticalSystem, lens: Lens, efficiency: float, care: Care = FULL) -> ProblemBound:
    """Return the bound for lenses of LENS_CLASS with a rear of this lens's area and at least this efficiency.

    An irradiance nearer to the target comes in larger images.  Lenses worse than rel_l2 = e need no other
    bound than e.  The images of all others are at least as large as those that belong to e.  With the bound b
    for these, min(e, b) holds for all.
    """
    for error in NEAR:
        images = problem_bound(system, image_half_width(system, lens, efficiency, error), care)
        if images.bound.lower_bound <= error:
            break
    return replace(images, bound=replace(images.bound, lower_bound=min(error, images.bound.lower_bound)))


def problem_bound(system: OpticalSystem, half_width: tuple[float, float], care: Care = FULL) -> ProblemBound:
    """Return the bound of a problem's target for images of the source at least so large.

    In the far field the arrays are intensities; d Omega / (du dv) is taken as constant over an image of the
    source.

    half_width : of the images, mm (degrees in the far field)
    """
    screen = system.target.screen()
    target = system.target.irradiance(screen, 1.0) / screen.projection()
    wide, high = (2 * h / p for h, p in zip(half_width, screen.pitch))
    wanted = max(1, ceil(max(wide, high) / care.widest), ceil(max(screen.pixels) / care.pixels))
    merge = max(1, min(wanted, min(screen.pixels) // LEAST_PIXELS))
    bound = image_bound(target, (wide, high), system.source.profile, merge)
    return ProblemBound(half_width, (wide, high), bound)
