"""What the shop must hold of the form, in sentences and rows of a table."""

from __future__ import annotations

from optics.tolerancing.form_errors.allowed_errors import FormErrors, SideCost

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
    words = (_danger, _peak_to_valley_misleads)
    said = [sentence(cost) for cost in errors.sides for sentence in words]
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


def _danger(cost: SideCost) -> str:
    """Return where ripples cost most, and what to hold there, as sentences."""
    (short, long), band = cost.danger.band, cost.danger
    return (
        f"Ripples of the {cost.side} with periods from {short:g} to {long:g} mm are the most dangerous: "
        f"there an error of given slope costs most. Hold {height_text(band.allowed_rms)} rms in this band, "
        f"and a regular ripple, at its worst period and direction, {height_text(band.allowed_pv_sine)} peak "
        "to valley."
    )


def _peak_to_valley_misleads(cost: SideCost) -> str:
    """Return why the peak to valley alone says little, as sentences."""
    (_, short), (long, _) = cost.bands[0].band, cost.bands[-1].band
    ratio = cost.bands[-1].allowed_pv_sine / cost.bands[0].allowed_pv_sine
    return (
        f"Peak to valley alone misleads on the {cost.side}: for the same loss a ripple with a period above "
        f"{long:g} mm may be {ratio:.3g} times as high as one with a period below {short:g} mm. "
        "State the rms by bands of period."
    )
