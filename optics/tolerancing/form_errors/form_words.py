"""What the shop must hold of the form, in sentences and rows of a table."""

from __future__ import annotations

from optics.tolerancing.form_errors.allowed_errors import FormErrors

FORM_HEAD = (
    "side",
    "period",
    "allowed rms",
    "peak to valley of a regular ripple",
    "of a random field",
    "formula / probes",
    "MTF",
    "rel_l2 traced",
)
NM, UM = 1e6, 1e3  # per mm


def height_text(height: float) -> str:
    """Return a height, mm, in nm, or in um from one on."""
    return f"{NM * height:.3g} nm" if UM * height < 1 else f"{UM * height:.3g} um"


def form_sentences(errors: FormErrors) -> list[str]:
    """Return what the shop must hold of both sides, and of what light that is said where there is other."""
    said = []
    for cost in errors.sides:
        first, band, last = cost.bands[0], cost.danger, cost.bands[-1]
        said.append(
            f"Ripples of the {cost.side} with periods from {band.band[0]:g} to {band.band[1]:g} mm are the "
            "most dangerous: there an error of given slope costs most. Hold "
            f"{height_text(band.allowed_rms)} rms in this band, and a regular ripple, at its worst period "
            f"and direction, {height_text(band.allowed_pv_sine)} peak to valley."
        )
        said.append(
            f"Peak to valley alone misleads on the {cost.side}: for the same loss a ripple with a period "
            f"above {last.band[0]:g} mm may be {last.allowed_pv_sine / first.allowed_pv_sine:.3g} times as "
            f"high as one with a period below {first.band[1]:g} mm. State the rms by bands of period."
        )
    if errors.spectral:
        said.append(
            f"Form errors are traced at the design wavelength alone, {errors.wavelength:g} nm; "
            f"there the design has rel_l2 = {errors.rel_l2:.2%}."
        )
    return said


def form_rows(errors: FormErrors) -> list[tuple[str, ...]]:
    """Return a row of texts for every band of both sides, under FORM_HEAD."""
    return [
        (
            cost.side,
            f"{band.band[0]:g} to {band.band[1]:g} mm",
            height_text(band.allowed_rms),
            height_text(band.allowed_pv_sine),
            height_text(band.allowed_pv_field),
            f"{band.by_formula / band.change_per_mm:.2f}",
            f"{band.mtf:.2f}",
            f"{band.traced_rel_l2:.2%}",
        )
        for cost in errors.sides
        for band in cost.bands
    ]
