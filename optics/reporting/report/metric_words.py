"""The numbers of a report in words: with a unit, three or four digits, and what they mean."""

from collections.abc import Iterator, Mapping
from html import escape
from math import isinf
from typing import Any

from optics.base.runtime import plain_number
from optics.light.analysis import counted_ways, error_words, passing_words
from optics.light.tracing import fate_sentences
from optics.scene.photometry import BEAM, FIELD, Units

PERCENT = "%"
FLUXES = ("W", "lm")
DEVIATION = "how far that value may be off, as a standard deviation"
NONE = 1e-9  # of a flux of 1: less is rounding
# unit and meaning of the metrics by name, where the unit is always the same; those of a group by its name
WORDS = {
    "version": ("", "of the definitions of these numbers"),
    "rel_l2": (PERCENT, "rel_l2_debiased with the noise of the measurement in it"),
    "psnr_db": ("dB", "peak signal-to-noise ratio; the peak is the brightest pixel asked for"),
    "ssim": ("", "structural similarity, 1 for equal pictures"),
    "rel_l2_floor": (PERCENT, "error of the measured irradiance itself, on the scale of rel_l2"),
    "rel_l2_debiased": (
        PERCENT,
        "difference from the light asked for, ||E - T|| / ||T||, both scaled to mean 1: what is quoted",
    ),
    "rel_l2_sharp": (PERCENT, "rel_l2 without divergence of the light and roughness of the surfaces"),
    "rel_l2_one_blur": (PERCENT, "what one blur everywhere, that of this lens, allows at best: a model"),
    "rel_l2_by_etendue": (PERCENT, "what etendue allows any solid that brings as much light, at best"),
    "rel_l2_diffraction": (PERCENT, "what waves leave of a lens that is perfect by rays: an estimate"),
    **{
        f"diffraction_blur_{unit}": (unit, "least blur by diffraction, lambda L / D")
        for unit in ("mm", "degrees")
    },
    "rel_l2_design_wavelength": (PERCENT, "rel_l2 in light of source.wavelength alone, by front and rear"),
    "from_nm": ("nm", "shorter one of two wavelengths whose rays are compared"),
    "to_nm": ("nm", "longer one of them"),
    "shift": ("", "mean distance of their landing points, mm; degrees in the far field"),
    "shift_pixels": ("pixels", "the same in pixels"),
    "fringe": ("", "mean distance of the chromaticity (u', v') from the source's, by luminance"),
    "rel_l2_sequential": (PERCENT, "rel_l2 of the light from surface to surface only, without noise"),
    "contrast_error": (PERCENT, "||E - T|| / ||T - mean T|| of unit means, without noise; 100 of even light"),
    "rays": ("", "rays that measured the light, about"),
    "pixels": ("", "columns and rows of the target on which these rays were counted"),
    "rays_of_file": ("", "rays that the source's file has: all of them measured the light"),
    "paths": ("", "light that counts: all ways through the lens, or from surface to surface only"),
    "estimator": ("", "what was traced: cells between rays, beams of such cells, or single rays"),
    "efficiency": (PERCENT, "of the source flux arrives inside the target"),
    "lit_efficiency": (PERCENT, "of the source flux arrives on the pixels that are to be lit"),
    "stray": (PERCENT, "of the source flux goes on and misses the target"),
    "polarisation_change": (
        PERCENT,
        "more light on the target than with the mean of s and p at every face",
    ),
    "crosstalk": (
        PERCENT,
        "of the middle source's flux goes forward and last left the glass by a neighbour's front or rear",
    ),
    "by_plate_edges": (PERCENT, "of the middle source's flux leaves a plate forward by its walls and land"),
    "normal_incidence_transmittance": (
        PERCENT,
        "passes two uncoated faces once at normal incidence; no bound",
    ),
    "row_transmittance": (PERCENT, "passes all elements at normal incidence; no bound"),
    "coated_transmittance": (PERCENT, "passes front and rear, as coated, at normal incidence; no bound"),
    "element": ("", "what makes the light"),
    "reflectance": (PERCENT, "of the light that meets the mirror's face goes on, at any angle"),
    "by_other_ways": (PERCENT, "of the light on the target comes by other ways than front and rear"),
    "missed": ("", "elements that light passes by on its way to the target"),
    "holders": ("", "options that say that opaque holders stop this light"),
    "share_of_target": (PERCENT, "of the light on the target passes by elements"),
    "past_on_target": (PERCENT, "of the source flux passes by elements and arrives inside the target"),
    "past_off_target": (PERCENT, "of the source flux passes by elements and misses the target"),
    "dof": ("", "degrees of freedom of the free surfaces"),
    "levels": ("", "levels of the finest mesh"),
    "evaluations": ("", "evaluations of loss and gradient"),
    "wall_s": ("s", "wall time of the phase"),
    "peak_mb": ("MB", "most memory of all processes, added"),
    "contrast_error_std": (PERCENT, DEVIATION),
    **{
        f"{name}_error": (PERCENT, DEVIATION)
        for name in ("rel_l2", "rel_l2_sequential", "efficiency", "lit_efficiency", "stray", "crosstalk")
    },
}
# of the light on pixels that are lit wholly, and of the beam in the far field
JUDGED = {
    "min_over_mean": ("", "U0: minimum over mean light of the boxes that count"),
    "min_over_max": ("", "least over greatest light of these boxes"),
    "rsd": ("", "relative standard deviation of their light, without noise"),
    **{f"{name}_error": ("", DEVIATION) for name in ("min_over_mean", "min_over_max", "rsd")},
    "noise": (PERCENT, "greatest standard deviation of a box, relative to the mean light"),
    "reason": ("", "why there is no uniformity; empty where there is"),
    "grid": ("", "boxes in each direction over the lit region's bounding rectangle"),
    "boxes": ("", "boxes that count: those in the region without its margin"),
    "region_left": (PERCENT, "of the region, without its margin"),
    **{
        f"{name}_{unit}": (unit, meaning)
        for unit in ("mm", "degrees")
        for name, meaning in (
            ("box", "width and height of a box"),
            ("margin", "taken off along the region's border"),
            ("blur_rms", "rms deviation of the light of one point of the lens, in one direction"),
            ("edge_width", "over which light falls from 90 to 10 % at the region's border"),
        )
    },
    "peak_cd_per_klm": ("cd/klm", "intensity of the brightest pixel for 1000 lm of the source"),
    **{
        f"{angle}_{plane.lower()}{end}": ("degrees", meaning)
        for angle, share in (("beam_angle", BEAM), ("field_angle", FIELD))
        for plane in ("C0", "C90")
        for end, meaning in (
            ("", f"full width at {share:.0%} of the peak, plane {plane}"),
            ("_error", DEVIATION),
            ("_at_least", "the same where the light goes on beyond the target: it is at least this wide"),
        )
    },
}


def words_of(units: Units) -> dict[str, tuple[str, str]]:
    """Return (unit, meaning) of all metrics by name; those of a group by its name."""
    flux, plane, far = units.flux, units.in_plane, units.in_far_field
    lit = "mean of the pixels that are to be lit wholly"
    return {
        **WORDS,
        **JUDGED,
        units.key("fates"): (flux, "traced from surface to surface"),
        "nonsequential": (flux, "traced with all reflections at all faces"),
        units.key("lit_direct"): (flux, "on the pixels that are to be lit, by front and rear alone"),
        units.key("lit"): (flux, "on the pixels that are to be lit, by all ways"),
        units.key("target"): (flux, "on the target, by all ways"),
        "fit": (PERCENT, "misfit of the optimiser's own rays to the light asked for, at the end"),
        "fresh_fit": (PERCENT, "the same of rays that it has not seen"),
        f"target_mean_{plane.suffix}": (plane.shown, f"mean {plane.quantity} of the whole target"),
        f"lit_mean_{plane.suffix}": (plane.shown, lit),
        f"lit_mean_{far.suffix}": (far.shown, lit),
        f"peak_{far.suffix}": (far.shown, "intensity of the brightest pixel"),
    }


def number_text(value: Any, unit: str = "") -> str:
    """Return a value with four digits, fractions of one in percent with three; of a list by x."""
    if value is None:
        return "not defined"
    if isinstance(value, list):
        return " x ".join(number_text(part, unit) for part in value)
    if not isinstance(value, float):
        return str(value)
    if isinf(value):
        return "infinite"
    if unit in (PERCENT, *FLUXES) and abs(value) < NONE:
        return "0"
    if unit == PERCENT:
        return f"{100 * value:.3g}"
    return plain_number(value)


def metric_rows(metrics: Mapping[str, Any], units: Units) -> Iterator[tuple[str, str, str, str]]:
    """Yield (name, value, unit, meaning) of metrics; those of a group have its name before theirs."""
    known = words_of(units)
    for name, value in metrics.items():
        if name == "zones":
            for row in value:
                limit = f"at {'least' if row['at_least'] else 'most'} {number_text(row['limit'])}"
                yield f"{name} {row['name']}", number_text(row["value"]), row["unit"], limit
            continue
        parts = list(_parts(value))
        sentences = fate_sentences(part for part, _ in parts)
        for part, number in parts:
            unit, meaning = known.get(part) or known.get(name, ("", ""))
            words = f"light that {sentences[part]}; {meaning}" if part in sentences else meaning
            row_name = f"{name} {part}".rstrip()
            yield row_name, number_text(number, unit), unit if number is not None else "", words


def _parts(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of a group by their names, or the one value by no name."""
    if not isinstance(value, Mapping):
        yield name, value
        return
    for part, inner in value.items():
        yield from _parts(inner, part)


SECONDS_OF_A_MINUTE = 60
LONG = 120.0  # s, from which on a time is said in minutes


def key_numbers(metrics: dict[str, Any], units: Units) -> Iterator[tuple[str, str, str]]:
    """Yield (name, value with its unit, meaning) of the main metrics, in plain words.

    Of uniform light these are its uniformity, how bright it is, and how much of it is where it shall be.
    """
    found = metrics.get("uniformity") or {}
    uniform = found if found.get("min_over_mean") is not None else {}
    if uniform:
        yield (
            "Uniformity U0",
            number_text(uniform["min_over_mean"]),
            "least over mean light of the lit region",
        )
        for quantity in (units.in_plane, units.in_far_field):
            if f"lit_mean_{quantity.suffix}" in uniform:
                value = number_text(uniform[f"lit_mean_{quantity.suffix}"])
                yield f"Mean {quantity.quantity}", f"{value} {quantity.shown}", "of the lit region"
        lit = f"{number_text(metrics['lit_efficiency'], PERCENT)} %"
        yield "Light on the lit region", lit, f"of the light of the source; {passing_words(metrics)}"
    yield (
        "Difference from the light asked for",
        error_words(metrics),
        "root mean square over the target, relative to that of the light asked for; 0 is perfect; "
        f"{counted_ways(metrics)}",
    )
    if not uniform:
        light = f"{number_text(metrics['efficiency'], PERCENT)} %"
        yield "Light on the target", light, f"of the light of the source; {passing_words(metrics)}"
    yield (
        "Stray light",
        f"{number_text(metrics['stray'], PERCENT)} %",
        f"of the light of the source goes on, through the {metrics.get('element', 'lens')} or past it, and "
        "misses the target",
    )
    mean = next((name for name in metrics if name.startswith("target_mean_")), None)
    if mean and not uniform:
        shown = units.in_plane
        yield (
            f"Mean {shown.quantity}",
            f"{number_text(metrics[mean])} {shown.shown}",
            "of the whole target",
        )


def key_list(metrics: dict[str, Any], units: Units) -> str:
    """Return the main metrics as a list in HTML."""
    items = (
        f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd><dd>{escape(meaning)}</dd></div>"
        for name, value, meaning in key_numbers(metrics, units)
    )
    return f'<dl class="key">{"".join(items)}</dl>'


def effort_sentence(metrics: Mapping[str, Any]) -> str:
    """Return what the design took."""
    return (
        f"{metrics['dof']} coefficients of splines, chosen by {metrics['evaluations']} evaluations; "
        f"{_duration(metrics['wall_s']['total'])} from the problem to the verified file."
    )


def _duration(seconds: float) -> str:
    if seconds < LONG:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), SECONDS_OF_A_MINUTE)
    return f"{minutes} min {rest} s"
