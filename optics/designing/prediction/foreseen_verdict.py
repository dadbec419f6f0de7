"""What of the limits of [verify] a design will miss, and whether its body fails, as far as that is known
before it."""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, degrees, hypot, inf

from optics.base.runtime import Backend
from optics.designing.prediction.blurred_picture import BlurLimits, wider_picture
from optics.designing.prediction.displaced_pictures import DisplacedLimits
from optics.designing.prediction.expectation import TAKEN, Expectation
from optics.light.analysis import PICTURE_REL_L2, contrast_error, picture_limit
from optics.light.blur import spot_rms
from optics.scene.photometry import BoxGrid
from optics.scene.system import System

WILL = "this design will miss its limit"
MAY = "this design may miss its limit"
# pixels, of a spot: from so wide on light that aims between their middles comes no nearer than is told
WIDE = 4.0
ASIDE = 20  # degrees, from which on aiming the lens itself is worth a word: it bends light by about as much


def foreseen_misses(
    system: System,
    expected: Expectation,
    blur: BlurLimits | None,
    backend: Backend,
    displaced: DisplacedLimits | None = None,
) -> list[str]:
    """Return a sentence for every limit that a design will miss, or may miss, for the remedy of a blur, and
    for a body that fails.

    blur, displaced : what the blur, and the displacement of a plate's lenses, leave of the picture, where
        there are any.
    """
    sentences = [*_of_the_error(system, expected, blur, displaced), *_wider(system, blur, backend)]
    region, limits = system.target.uniform_region, system.problem.verify
    if region is not None and (limits.min_over_mean or limits.min_over_max or limits.rsd < inf):
        wide = spot_rms(system.unshaped, backend)
        found = BoxGrid(region, limits.grid, wide).without_light()
        if found.reason:  # the blur is as wide as the region
            sentences.append(
                f"the uniformity may stay undecided: of the base lens {found.reason}; or make the "
                "region larger, or --set verify.min_over_mean=0 --set verify.min_over_max=0 "
                "--set verify.rsd=inf"
            )
    if expected.efficiency < limits.lit_efficiency:
        sentences.append(
            f"{MAY}: {expected.efficiency:.0%} of the source's light reach the target at the start of the "
            f"design, and verify.lit_efficiency asks for {limits.lit_efficiency:.0%} on the lit region"
            f"{_aside(system)}"
        )
    if expected.past:
        sentences.append(f"{MAY}: {expected.past}")
    poor = bool(expected.doubt) and (expected.base_rel_l2 or 0.0) > PICTURE_REL_L2
    if poor and not system.blurred:  # what is known of the start is its sharp light
        sentences.append(f"{MAY}: {expected.doubt}")
    sentences += _of_stops(system, expected)
    sentences += [f"{MAY}: {cost.sentence}" for cost in expected.limit_costs]
    return sentences


def _of_stops(system: System, expected: Expectation) -> Iterator[str]:
    """Yield a sentence where stops take so much light that it shows on the target."""
    limit = picture_limit(system.problem.verify, not system.target.as_picture)
    shows = limit if limit < inf else PICTURE_REL_L2  # uniform light has limits of other names
    error = expected.start_rel_l2 if system.target.settings.kind != "zones" else None
    if expected.blocked < TAKEN or error is None or error <= shows:
        return
    which = (
        "which the start of the design does not take into account"
        if expected.from_transport
        else "with the surface of the transport map, from which this design does not start"
    )
    blocking = " and ".join(expected.blocking)
    blocked = f"{expected.blocked:.1%} of the light is blocked by {blocking}"
    yield f"{MAY}: {blocked}, {which}; rel_l2 is {error:.2g}"


def _aside(system: System) -> str:
    """Return how far the middle of the target lies off the axis of the one lens, with a remedy, or ""."""
    target = system.problem.target
    if target.position is None or system.problem.element:
        return ""
    x, y, z = target.position
    angle = degrees(atan2(hypot(x, y), z - system.base.thickness))
    remedy = "aim the axis at it: target.distance in place of position, and another target.tilt"
    return f"; the target's middle lies {angle:.0f} degrees off the axis: {remedy}" if angle > ASIDE else ""


def _of_the_error(
    system: System, expected: Expectation, blur: BlurLimits | None, displaced: DisplacedLimits | None
) -> Iterator[str]:
    """Yield what blur and detail forbid of a picture: rel_l2, and what it is of the picture's contrast."""
    # light may come a little nearer where a spot is few pixels wide, since it need not aim at their middles
    sure = blur is not None and blur.width >= WIDE * blur.pixel
    word, why = (WILL, "the blur allows") if sure else (MAY, "one blur leaves")
    known = [
        (word, blur.least if blur else None, why),
        (MAY, expected.rel_l2, "about as much is to be expected:"),
        (MAY, displaced.least if displaced else None, "the displaced pictures of the lenses leave"),
    ]
    for word, value, why in known:
        if value is None:
            continue
        for key, found, limit in _missed(system, value):
            least = " at least" if word == WILL else ""
            yield f"{word}: {why} a {key} of {found:.2g}{least}, and verify.{key} asks for {limit:g}"


def _missed(system: System, value: float) -> list[tuple[str, float, float]]:
    """Return (key, what it is, its limit) of each limit of [verify] that light with a rel_l2 misses."""
    limits, uniform, screen = system.problem.verify, not system.target.as_picture, system.target.screen()
    target = system.target.irradiance(screen, 1.0) / screen.projection()
    of_contrast = contrast_error({"rel_l2_debiased": value, "rel_l2_error": 0.0}, target)["contrast_error"]
    rows = [("rel_l2", value, picture_limit(limits, uniform))]
    if not uniform and of_contrast is not None:
        rows.append(("contrast_error", of_contrast, limits.contrast_error))
    return [row for row in rows if row[1] > row[2]]


def _wider(system: System, blur: BlurLimits | None, backend: Backend) -> Iterator[str]:
    """Yield the remedy where the blur forbids the light asked for."""
    if blur is None or blur.least is None or not _missed(system, blur.least):
        return
    half = wider_picture(system, backend, lambda least: not _missed(system, least))
    if half is not None:
        where = "" if system.target.receiver.far_field else "at this distance "
        yield (
            f"a larger target has wider detail, and the blur stays: {where}--set "
            f"target.half_width=[{half[0]:g},{half[1]:g}] may keep these limits"
        )
