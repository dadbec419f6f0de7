"""What etendue says about a problem, in two bounds: for every lens, and for lenses of one blur everywhere."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, floor, inf, log10, prod
from typing import Any, NamedTuple

from optics.designing.etendue.brightness_limit import UniversalBound, universal_bound
from optics.designing.etendue.source_image_bound import ImageBound, any_proportions, image_bound
from optics.designing.etendue.throughput_bound import (
    bounds_hold,
    front_fraction,
    image_half_width,
    rear_area,
)
from optics.light.analysis import passing_share
from optics.scene.problem import freedom_of
from optics.scene.system import System

LEAST_PIXELS = 4  # in each direction, that merging leaves
DIGITS = 4  # of what is printed, rounded so that a bound stays one
UNBOUND = (
    "etendue bounds the light of one lens on planes and in the far field; no bound is given of a curved "
    "target, or of a plate of lenses"
)
FORMS = {  # of the source's image, by the kind of its profile
    "uniform": "uniform rectangle along x and y",
    "round": "uniform ellipse along x and y",
    "gaussian": "Gaussian",
    "round_gaussian": "Gaussian cut off at an ellipse",
    "image": "picture",
}
# rel_l2 of the lenses that a bound is made for; the second where no lens attains the first
NEAR = 0.25, 1.0


@dataclass(frozen=True)
class Care:
    """How sharp a bound is made.

    widest : merged pixels across a square image, at most
    pixels : merged pixels in each direction of the target, at most
    finest : KKT residual of the solver
    most : sizes solved in the search over proportions, at most
    """

    widest: float
    pixels: float
    finest: float = 1e-5
    most: int = 0


FIXED = Care(12.0, float("inf"))  # in the source's proportions
FIXED_QUICK = Care(8.0, 256.0)  # some seconds
SEARCH = Care(5.0, 128.0, 1e-4, 100)  # over all proportions
SEARCH_QUICK = Care(3.5, 64.0, 1e-4, 30)  # some seconds: beside other work


@dataclass(frozen=True, eq=False)
class OneBlur:
    """Bounds of rel_l2 for lenses that throw the same image of the source through every point of the rear.

    half_width : of the least images in the proportions of the source, mm (degrees in the far field)
    width : of these, pixels
    bound : for images of at least this area; for `any_proportions` or for those of the source
    filled : share of a rectangle of this width that an image shines on
    """

    half_width: tuple[float, float]
    width: tuple[float, float]
    bound: ImageBound
    filled: float = 1.0


def usual_efficiency(system: System, universal: UniversalBound | None = None) -> float:
    """Return the efficiency at which a problem is judged before there is a lens.

    It is that of all light on the first face, of which every face passes what it does at normal incidence, or
    what can arrive where that is less.  It is no bound.
    """
    (share,) = passing_share(system.unshaped.path).values()
    usual = (1.0 if share is None else share) * front_fraction(system)
    return usual if universal is None else min(usual, universal.most_on_target / universal.flux)


def one_blur_tells(system: System) -> bool:
    """Return whether one blur everywhere is a model of a system: of one source and a lens on the axis."""
    return system.axial and system.problem.source.lone


def one_blur(system: System, efficiency: float, care: Care = SEARCH, any_form: bool = True) -> OneBlur:
    """Return the bound for lenses of one blur, with a rear of this lens's area and at least this efficiency.

    An irradiance nearer to the target comes in larger images.  Lenses worse than rel_l2 = e need no other
    bound than e.  The images of all others are at least as large as those that belong to e.  With the bound b
    for these, min(e, b) holds for all lenses of the class.  No measured value takes part.

    any_form : uniform images of any proportions; otherwise the source's own
    """
    for error in NEAR:
        half_width = image_half_width(system, efficiency, error)
        images = images_bound(system, half_width, care, any_form)
        if images.bound.lower_bound <= error:
            break
    return replace(images, bound=replace(images.bound, lower_bound=min(error, images.bound.lower_bound)))


def images_bound(
    system: System, half_width: tuple[float, float], care: Care = SEARCH, any_form: bool = True
) -> OneBlur:
    """Return the bound of a problem's target for alike images of the source at least so large.

    In the far field the arrays are intensities; d Omega / (du dv) is taken as constant over an image of the
    source.

    half_width : of the images in the proportions of the source, mm (degrees in the far field)
    """
    screen = system.target.screen()
    target = system.target.irradiance(screen, 1.0) / screen.projection()
    wide, high = (2 * h / p for h, p in zip(half_width, screen.pitch))
    wanted = max(1, ceil(prod((wide, high)) ** 0.5 / care.widest), ceil(max(screen.pixels) / care.pixels))
    merge = max(1, min(wanted, min(screen.pixels) // LEAST_PIXELS))
    if any_form:
        bound = any_proportions(target, wide * high, merge, care.finest, care.most)
    else:
        bound = image_bound(target, (wide, high), system.source.image[0], merge, care.finest)
    return OneBlur(half_width, (wide, high), bound, 1.0 if any_form else system.source.image[0].area / 4)


def one_blur_sentence(system: System) -> str:
    """Return what one blur everywhere means for a source."""
    form = FORMS[system.source.image[0].kind]
    return (
        "one blur everywhere is a model that smooth, slowly varying lenses resemble, and no bound for "
        f"lenses: the same {form} is the source's image through every point of the rear"
    )


def stretchable(system: System) -> bool:
    """Whether images of any proportions can be bounded: those of a uniform rectangle."""
    return system.source.image[0].kind == "uniform"


class EtendueNotes(NamedTuple):
    """What etendue says.  limits : sentences on what it forbids.  background : those that forbid nothing."""

    limits: list[str]
    background: list[str]


def etendue_notes(system: System) -> EtendueNotes:
    """Return sentences on what etendue says about a problem; none for sources without extent.

    The blur of a beam is known, and needs no bound.  That of a lens off the axis, or of a mirror, is no
    model.  z_freedom must be known.
    """
    notes = EtendueNotes([UNBOUND] if system.source.etendue and not bounds_hold(system) else [], [])
    if not bounds_hold(system):
        return notes
    universal = universal_bound(system)
    efficiency = usual_efficiency(system, universal)
    said = [universal_sentence(system, universal, efficiency), *universal_lines(system, universal)]
    free = universal.least_rel_l2(efficiency) == 0 and universal.exact_efficiency >= 1
    (notes.background if free else notes.limits).extend(said)
    if system.source.diverging or not one_blur_tells(system):
        return notes
    images = one_blur(system.unshaped, efficiency, SEARCH_QUICK, stretchable(system))
    _place(
        notes,
        images,
        f"{one_blur_sentence(system)}, {base_rear(system)}; at this efficiency "
        f"{blur_sentence(images, stretchable(system))}",
    )
    return notes


def _place(notes: EtendueNotes, images: OneBlur, sentence: str) -> None:
    """Add a sentence on one blur everywhere to the notes: to the limits where its bound is more than 0."""
    forbids = images.bound.lower_bound >= 10.0**-DIGITS
    (notes.limits if forbids else notes.background).append(sentence)


def reached_sentences(system: System, metrics: dict[str, Any]) -> EtendueNotes:
    """Return sentences on what etendue says about a finished design; none where it sets no limit.

    metrics : rel_l2_debiased and efficiency of the design
    """
    efficiency, rel_l2 = metrics["efficiency"], metrics["rel_l2_debiased"]
    notes = EtendueNotes([], [])
    if not bounds_hold(system) or not efficiency:
        return notes
    universal = universal_bound(system)
    least = universal.least_rel_l2(efficiency)
    first = f"rel_l2 reached {rel_l2:.4f}; {universal_sentence(system, universal, efficiency)}"
    if least is None or rel_l2 < least:
        first += "; this lens does, so it is not within the envelope or was not measured well enough"
    (notes.background if least == 0 else notes.limits).extend([first, curve_sentence(system, universal)])
    if system.source.diverging or not one_blur_tells(system):
        return notes
    forms = [(True, SEARCH_QUICK)] * stretchable(system) + [(False, FIXED_QUICK)]
    area = f"{rear_area(system.designed):.4g} mm^2 as this lens has it"
    model = f"{one_blur_sentence(system)}, {area}; at this efficiency "
    for any_form, care in forms:
        images = one_blur(system, efficiency, care, any_form)
        left = "; this lens lies below and left the class: its images of the source are not all alike"
        below = rel_l2 < images.bound.lower_bound
        _place(notes, images, model + blur_sentence(images, any_form) + (left if below else ""))
        model = "one blur everywhere, too: "
    return notes


def universal_sentence(system: System, universal: UniversalBound, efficiency: float) -> str:
    """Return the universal bound in one sentence, with its class."""
    problem, least = system.problem, universal.least_rel_l2(efficiency)
    last = problem.faces_met[-1].optic
    freedoms = [f"{last.face_name(side)} {f.freedom:g} mm" for side, f in last.free.items()]
    faces = ["six faces" if system.lone_lens else f"the whole {problem.face_names[-1]}"]
    if freedoms:
        faces.append(f"z_freedom {' and '.join(freedoms)} included")
    noun, which = _noun(system), "within" if len(problem.optics) == 1 else "whose last element lies within"
    all_ways, any_way = (", with light by all its paths,", ", by any path") if system.lone_lens else ("", "")
    envelope = f"{which} the envelope ({', '.join(faces)})"
    brought = f"{efficiency:.4g} of the source's light to the target"
    if least == 0:
        return f"etendue forbids no rel_l2 to {noun}s {envelope} that bring {brought}{any_way}"
    below = "" if least is None else f" with rel_l2 below {rounded_down(least)}"
    return f"by etendue no {noun} {envelope}{all_ways} brings {brought}{below}"


def _noun(system: System) -> str:
    """Return what the universal bound is one of all."""
    if system.lone_lens:
        return "solid"
    return system.problem.optic.noun if len(system.problem.optics) == 1 else "row"


def universal_lines(system: System, universal: UniversalBound) -> list[str]:
    """Return sentences on the most light of these lenses, and on the picture itself."""
    flux, density = system.units.flux, system.density
    exact, noun = universal.exact_efficiency, _noun(system)
    return [
        f"of any such {noun} at most {rounded_up(universal.most_on_target)} {flux} reach the target, "
        f"at most {rounded_up(universal.most_on_lit)} {flux} the pixels where light is asked for, "
        f"and no pixel gets more than {rounded_up(density.factor * universal.peak)} {density.shown}",
        "etendue alone forbids the picture itself "
        + (f"from an efficiency of {rounded_up(exact)} on" if exact < 1 else "at no efficiency"),
    ]


def curve_sentence(system: System, universal: UniversalBound) -> str:
    """Return the least rel_l2 of any such lens over the efficiency, in one sentence."""
    curve = universal.curve()
    free = [efficiency for efficiency, least in curve if least == 0]
    parts = [f"{rounded_down(0.0)} up to {free[-1]:g}"] if free else []
    parts += [f"{rounded_down(least)} at {efficiency:g}" for efficiency, least in curve if least]
    if any(least is None for _, least in curve):
        parts.append(f"no light beyond {rounded_up(universal.most_on_target / universal.flux)}")
    return f"least rel_l2 of any such {_noun(system)} by its efficiency: {', '.join(parts)}"


def blur_sentence(images: OneBlur, any_form: bool = True) -> str:
    """Return the bound of one blur in a part of a sentence, with its class."""
    form = "of any proportions" if any_form else "with the source's proportions"
    area = prod(images.width) * images.filled
    return (
        f"such images {form} and at least {area:.4g} square pixels leave a rel_l2 of "
        f"{rounded_down(images.bound.lower_bound)} at least"
    )


def base_rear(system: System) -> str:
    """Return words for the area of the rear before there is a design."""
    freedom, area = freedom_of(system.problem.optic.rear), f"{rear_area(system.base):.4g} mm^2"
    if not freedom:
        return f"{area} as the lens has it"
    return (
        f"{area} as the base lens has it "
        f"(z_freedom = {freedom:g} mm may make it larger, and the images smaller)"
    )


def rounded_down(value: float) -> str:
    """Return a lower bound of rel_l2 in DIGITS decimals, still a lower bound."""
    return f"{floor(value * 10**DIGITS) / 10**DIGITS:.{DIGITS}f}"


def rounded_up(value: float) -> str:
    """Return an upper bound in DIGITS digits, still an upper bound."""
    if not 0 < value < inf:
        return f"{value:g}"
    unit = 10.0 ** (floor(log10(value)) + 1 - DIGITS)
    return f"{ceil(value / unit * (1 - 1e-12)) * unit:.{DIGITS}g}"
