"""Whether a lens does its job: limits of what it delivers, the verdict, and sentences on lost light.

Light that shall be the same everywhere is judged by its uniformity on boxes, other light as a picture; where
there are zones, by each of their rows.  The other limits are those of the problem's [verify]; they never
follow what a lens can do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf, isinf
from typing import Any

from optics.base.runtime import RESOLVED, Check, Grade, grade
from optics.light.analysis.light_of_rays import pixels_for
from optics.light.tracing import fate_sentences
from optics.scene.limits import names_cost
from optics.scene.photometry import Units
from optics.scene.problem import Verify

WORTH_A_NOTE = 0.1  # of the source flux, lost on one way; of the light on the target, where it is to be dark
FEWER_DARK = "optimizer.dark_flux_weight, raised, trades evenness for less of it"
WHAT_HELPS = (
    "a smaller source, a larger lens, a farther or larger target, softer edges, a second free surface or a "
    "higher max_level may help"
)
UNJUDGED = "--set verify.min_over_mean=0 --set verify.min_over_max=0 --set verify.rsd=inf judges without it"
BEYOND = "the light goes on beyond the target; make target.half_width larger"
UNIFORMITY = "uniformity"  # begins the names of its checks, except that of RSD_NAME
RSD_NAME = "relative standard deviation of"
ERROR_NAME = "rel_l2, without noise"
CONTRAST_NAME = "error relative to the picture's contrast"
LIT_NAME = "light on the lit region, of the source's"
STRAY_NAME = "light beside the target, of the source's"
NO_ANGLES = 0.0, inf  # of a beam: no limit
PICTURE_REL_L2 = 0.1  # the limit of pictures where it is left to the program
FORBIDS = {"rel_l2_one_blur": "the blur", "rel_l2_by_etendue": "etendue"}  # least values of rel_l2
NEAR = 1.1  # times what is allowed at best: as near as can be
SHOWN = 5e-3  # of a value: an error from which on three digits show it


@dataclass(frozen=True)
class Verdict:
    """What is to be thought of a lens.

    grade : of `optics.base.runtime.grade`.  sentence : with the numbers first.  checks : that decided.
    notes : sentences on what limits the lens.
    """

    grade: Grade
    sentence: str
    checks: tuple[Check, ...]
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.sentence

    def data(self) -> dict[str, Any]:
        """Return grade, sentence and notes by name, for JSON files."""
        return {"grade": self.grade, "verdict": self.sentence, "notes": list(self.notes)}


def delivery_checks(metrics: dict[str, Any], limits: Verify) -> list[Check]:
    """Return the checks of what the lens delivers, for the limits that are set.

    metrics : of a Measurement.  Errors of the estimate make values undecided that lie near their limit.
    """
    return [
        *_zone_checks(metrics),
        *_beam_checks(metrics, limits),
        *uniformity_checks(metrics, limits),
        *_picture_and_flux_checks(metrics, limits),
    ]


def picture_limit(limits: Verify, uniform: bool) -> float:
    """Return the greatest rel_l2; inf is none.  uniform : light is not judged as a picture."""
    if not isinstance(limits.rel_l2, str):
        return limits.rel_l2
    return float("inf") if uniform else PICTURE_REL_L2


def _zone_checks(metrics: dict[str, Any]) -> Iterator[Check]:
    """Yield a check of the nearer limit of every row of the target's zones."""
    for row in metrics.get("zones", ()):
        margin = f"margin {row['margin']:+.0%}"
        if row["margin_in_errors"] is not None:
            margin += f", {row['margin_in_errors']:+.3g} standard errors"
        decides = _unless_resolved(metrics, row["value"], row["error"], row["limit"])
        remark = f"{margin}; {decides}" if decides else margin
        value, limit, error = row["value"], row["limit"], row["error"]
        yield Check(row["name"], value, limit, row["unit"], row["at_least"], error, "light", remark)


def uniformity_checks(metrics: dict[str, Any], limits: Verify) -> Iterator[Check]:
    """Yield the checks of uniform light; only one where its uniformity is not known, with the reason."""
    uniformity = metrics.get("uniformity")
    if uniformity is None or (uniformity["min_over_mean"] is None and _shape_is_limited(metrics, limits)):
        return
    symbol = "I" if "box_degrees" in uniformity else "E"
    rows = (
        ("min_over_mean", f"{UNIFORMITY} U0 = {symbol}_min / {symbol}_mean", limits.min_over_mean, True),
        ("min_over_max", f"{UNIFORMITY} {symbol}_min / {symbol}_max", limits.min_over_max, True),
        ("rsd", f"{RSD_NAME} {symbol}", limits.rsd, False),
    )
    for key, name, limit, at_least in rows:
        if (at_least and not limit) or isinf(limit):
            continue
        value, error = uniformity[key], uniformity[f"{key}_error"]
        if value is None:
            why = f"{uniformity['reason']}; or {UNJUDGED}"
            yield Check(UNIFORMITY, None, limit, "", at_least, 0.0, "light", why)
            return
        remark = _unless_resolved(metrics, value, error, limit)
        yield Check(name, value, limit, "", at_least, error, "light", remark)


def _shape_is_limited(metrics: dict[str, Any], limits: Verify) -> bool:
    """Return whether limits other than those of uniformity judge the shape of uniform light."""
    angles = limits.beam_angle, limits.field_angle
    of_beam = metrics.get("beam") is not None and any(angle != NO_ANGLES for angle in angles)
    return of_beam or picture_limit(limits, uniform=True) < inf


def _beam_checks(metrics: dict[str, Any], limits: Verify) -> Iterator[Check]:
    """Yield the checks of the angles of a beam in both of its planes."""
    beam = metrics.get("beam")
    for name in ("beam_angle", "field_angle"):
        least, greatest = getattr(limits, name)
        if beam is None or not (least or greatest < inf):
            continue
        for plane, planes in (("c0", "C0-C180"), ("c90", "C90-C270")):
            value, error = beam[f"{name}_{plane}"], beam.get(f"{name}_{plane}_error", 0.0)
            remark = ""
            if value is None:
                remark, bound = BEYOND, beam.get(f"{name}_{plane}_at_least")
                if bound is not None and (bound > greatest or (bound >= least and isinf(greatest))):
                    value = bound
            at_least = bool(least) and (
                isinf(greatest) or (value is not None and 2 * value < least + greatest)
            )
            limit = least if at_least else greatest
            called = f"{name.replace('_', ' ')} in {planes}"
            yield Check(called, value, limit, "degrees", at_least, error, "light", remark)


def _picture_and_flux_checks(metrics: dict[str, Any], limits: Verify) -> Iterator[Check]:
    off = picture_limit(limits, "contrast_error" not in metrics)
    contrast = inf if metrics.get("contrast_error") is None else limits.contrast_error
    rows = (
        ("rel_l2_debiased", "rel_l2_error", ERROR_NAME, off, False),
        ("contrast_error", "contrast_error_std", CONTRAST_NAME, contrast, False),
        ("lit_efficiency", "lit_efficiency_error", LIT_NAME, limits.lit_efficiency, True),
        ("stray", "stray_error", STRAY_NAME, limits.stray, False),
    )
    for key, of_error, name, limit, at_least in rows:
        if (limit or not at_least) and not isinf(limit):
            value, error = metrics[key], metrics.get(of_error, 0.0)
            remark = _unless_resolved(metrics, value, error, limit)
            yield Check(name, value, limit, "", at_least, error, "light", remark)


def _unless_resolved(metrics: dict[str, Any], value: float | None, error: float, limit: float) -> str:
    """Return how many rays would tell on which side of its limit a value lies; "" where that is known."""
    more = rays_to_decide(Check("", value, limit, "", error=error))
    if not metrics.get("rays") or more <= 1:
        return ""
    if isinf(more):
        return "the value equals its limit; more rays cannot decide"
    return _more_rays(metrics, more)


def rays_to_decide(check: Check) -> float:
    """Return how many times the rays decide on a check: (RESOLVED error / |value - limit|)^2, at least 1; inf
    of a value that equals its limit."""
    if check.value is None or not check.error:
        return 1.0
    gap = abs(check.value - check.limit)
    return max((RESOLVED * check.error / gap) ** 2, 1.0) if gap else inf


def _more_rays(metrics: dict[str, Any], factor: float) -> str:
    """Return what measures light by a multiple of its rays, as an option to copy."""
    rays, pixels = metrics["rays"], metrics.get("pixels")
    wanted = f"about {rays * factor:.1e} rays in place of {rays:.1e} would decide"
    if "rays_of_file" in metrics:
        return f"{wanted}: source.file has no more"
    if pixels is None:  # of an older result
        return f"{wanted}: more target.pixels are measured by more rays"
    finer = pixels_for(rays * factor, pixels)
    if finer is None:
        return f"{wanted}, which is more than any target.pixels bring"
    return f"{wanted}: --set target.pixels=[{finer[0]},{finer[1]}]"


def judged(
    metrics: dict[str, Any], checks: Sequence[Check], notes: Sequence[str] = (), of_file: bool = True
) -> Verdict:
    """Return the verdict on a lens.

    metrics : what it delivers.  checks : of its light, and of its file where there is one.
    of_file : the file was checked too.
    """
    found = grade(checks)
    worst = {"made": "passed", "not decided": "undecided"}.get(found, "failed")
    body = metrics.get("element", "lens")
    subject = {"light misses": "light", "file or part fails": "file"}.get(found)
    rows = [c for c in checks if c.result == worst and subject in (None, c.subject)]
    requested = any(check.subject == "light" for check in checks)
    makes = f"the {body} makes the light asked for" if requested else "no limit of the light is set"
    says = {
        "made": f"{makes}{f', and the file is the {body}' * of_file}",
        "light misses": "the light misses what was asked for",
        "file or part fails": "the file, the part or a limit of making fails",
        "not decided": "not decided",
    }[found]
    sentence = f"{headline(metrics, checks) if requested else arrival(metrics)}: {says}"
    if found != "made":
        more = f", and {len(rows) - 1} more" if len(rows) > 1 else ""
        why = rows[0].remark if rows[0].value is None else rows[0].wanted
        sentence += f": {rows[0].name} {rows[0].got} ({why}){more}"
    named = filter(names_cost, notes)  # limits of manufacture
    if found == "light misses" and (excuse := _excuse(metrics, rows) or next(named, "")):
        sentence += f"; {excuse}"
    return Verdict(found, sentence, tuple(checks), tuple(notes))


def arrival(metrics: dict[str, Any]) -> str:
    """Return how much light arrives on the target, in words."""
    return f"{metrics['efficiency']:.1%} of the light arrives on the target"


def headline(metrics: dict[str, Any], checks: Sequence[Check] = ()) -> str:
    """Return the numbers that tell most of the light, in words: first those that are judged."""
    if zones := metrics.get("zones"):
        margins = [row["margin"] for row in zones]
        return f"{sum(m >= 0 for m in margins)} of {len(zones)} rows kept, least margin {min(margins):+.0%}"
    names = {check.name for check in checks}
    uniformity, beam = metrics.get("uniformity") or {}, metrics.get("beam") or {}
    judged_numbers = [
        f"{name.replace('_', ' ')} {beam[f'{name}_c0']:.3g} x {beam[f'{name}_c90']:.3g} degrees"
        for name in ("beam_angle", "field_angle")
        if any(called.startswith(name.replace("_", " ")) for called in names)
        and None not in (beam[f"{name}_c0"], beam[f"{name}_c90"])
    ]
    off = f"{error_words(metrics)} off"
    if names & {ERROR_NAME, CONTRAST_NAME}:
        judged_numbers.append(off)
    if (
        any(name.startswith((UNIFORMITY, RSD_NAME)) for name in names)
        and uniformity.get("min_over_mean") is not None
    ):
        judged_numbers.append(f"U0 {uniformity['min_over_mean']:.2f}")
    if not judged_numbers and uniformity and LIT_NAME in names:
        judged_numbers.append(f"{metrics['lit_efficiency']:.0%} of the source's light on the lit region")
    if not judged_numbers:
        return off
    return ", ".join(judged_numbers) + (f" ({off})" if off not in judged_numbers else "")


def error_words(metrics: dict[str, Any]) -> str:
    """Return rel_l2 without the noise of its estimate, in per cent, and its error where that shows."""
    percent, error = 100 * metrics["rel_l2_debiased"], 100 * metrics["rel_l2_error"]
    return f"{percent:.3g} %" if error < SHOWN * percent else f"{percent:.3g} +- {float(f'{error:.1g}'):g} %"


def _excuse(metrics: dict[str, Any], missed: Sequence[Check]) -> str:
    """Return what forbids the picture that is missed, and whether the light comes as near as that allows."""
    pictures = {check.name: check.limit for check in missed if check.name in (ERROR_NAME, CONTRAST_NAME)}
    bounds = [(metrics[key], by) for key, by in FORBIDS.items() if metrics.get(key) is not None]
    if not pictures or not bounds:
        return ""
    (least, by), value = max(bounds), metrics["rel_l2_debiased"]
    if value <= NEAR * least:
        return f"{value:.2g} is as near as {by} allows ({least:.2g}), and not what was asked for"
    hopeless = least > pictures.get(ERROR_NAME, inf)
    return f"{by} allows {least:.2g} at best" if hopeless else ""


def loss_notes(metrics: dict[str, Any], units: Units) -> list[str]:
    """Return a sentence for every way on which much of the source flux is lost, and on light that passes by
    elements on its way to the target."""
    fates = metrics[units.key("fates")]
    flux, sentences = sum(map(abs, fates.values())), fate_sentences(fates)
    lost = [
        f"{some / flux:.0%} of the light {sentences[name]}"
        for name, some in fates.items()
        if name != "on_target" and not name.endswith("reflected") and some > WORTH_A_NOTE * flux
    ]
    return lost + past_notes(metrics)


def past_notes(metrics: dict[str, Any]) -> list[str]:
    """Return a sentence where light on the target misses an element, with what would stop it."""
    past = metrics.get("past_elements")
    if not past:
        return []
    missed = " and ".join("the lens" if name == "lens" else name for name in past["missed"])
    held = " ".join(f"--set {change}" for change in past["holders"])
    return [
        f"{100 * past['share_of_target']:.2g} % of the light on the target passes beside {missed}; if an "
        f"opaque holder stops it, say so by {held} or a [[stop]]; else make {missed} larger, or the beam "
        "narrower"
    ]


def unjudged_note(metrics: dict[str, Any], limits: Verify) -> list[str]:
    """Return a sentence where uniformity is not judged because it is not known and other limits judge the
    shape of the light."""
    uniformity = metrics.get("uniformity")
    if not uniformity or uniformity["min_over_mean"] is not None or not _shape_is_limited(metrics, limits):
        return []
    return [f"uniformity is not judged: {uniformity['reason']}"]


def dark_note(metrics: dict[str, Any]) -> list[str]:
    """Return a sentence where much of the light on the target is on pixels that are to be dark."""
    on, lit = metrics["efficiency"], metrics["lit_efficiency"]
    if on - lit <= WORTH_A_NOTE * on:
        return []
    return [f"{1 - lit / on:.0%} of the light on the target is where none is asked for; {FEWER_DARK}"]


def counted_ways(metrics: dict[str, Any]) -> str:
    """Return in words which light the metrics and the irradiance of a Measurement count."""
    alone = "the face only" if "element" in metrics else "front and rear only"
    if "row_transmittance" in metrics:
        alone = "the faces of the path only"
    return "all paths" if metrics["paths"] == "all" else alone
