"""Pictures of form errors: what a shop must hold against the period, and where on the lens (matplotlib)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from optics.figures import new_panels, png_bytes
from optics.form_errors import height_text

if TYPE_CHECKING:
    from optics.form_errors import FormErrors, SideCost

    Figures = dict[str, tuple[str, bytes]]  # (caption, PNG) by name

NM = 1e6  # per mm
PANEL = (3.6, 3.1)  # inches, of a map
BRIGHTEST = 0.98  # quantile that ends the scale of a map: folds of the light would take all of it


def form_figures_of(errors: FormErrors) -> Figures:
    """Return the figures of form errors: the allowed height by period, and maps of both sides."""
    rise = f"a rise of rel_l2 by {errors.rise:g} from {errors.rel_l2:.4f}"
    figures = {
        "form_allowed": (
            f"Form error that each band of period may have for {rise}: the rms, and the peak to valley of a "
            "regular ripple at its worst period and direction",
            allowed_figure(errors),
        )
    }
    for cost in errors.sides:
        figures[f"form_map_{cost.side}"] = (
            f"How much the light through each place of the {cost.side} changes: rms of dE / E at the allowed "
            "rms of each band",
            band_maps_figure(cost),
        )
    return figures


def allowed_figure(errors: FormErrors) -> bytes:
    """Return the allowed rms and peak to valley of a ripple against its period as a picture."""
    figure, (axes,) = new_panels(1)
    for colour, cost in zip(("C0", "C1"), errors.sides):
        periods = np.ravel([band.band for band in cost.bands])
        for heights, line, label in (
            ([band.allowed_pv_sine for band in cost.bands], "--", "peak to valley"),
            ([band.allowed_rms for band in cost.bands], "-", "rms"),
        ):
            shown = np.repeat(NM * np.array(heights), 2)
            axes.loglog(periods, shown, line, color=colour, label=f"{cost.side}, {label}")
    axes.set_xlabel("period / mm")
    axes.set_ylabel("allowed height error / nm")
    axes.grid(alpha=0.3, which="both")
    axes.legend(frameon=False)
    return png_bytes(figure)


def band_maps_figure(cost: SideCost) -> bytes:
    """Return maps of one side as a picture: rms of dE / E at the allowed rms, a panel for each band."""
    figure, panels = new_panels(len(cost.bands), PANEL)
    x, y = cost.points
    for axes, band, relative in zip(panels, cost.bands, cost.maps):
        percent = 100 * band.allowed_rms * relative
        top = float(np.quantile(percent, BRIGHTEST)) or 1.0
        shown = axes.pcolormesh(x, y, percent, vmin=0.0, vmax=top, cmap="magma", rasterized=True)
        axes.set_aspect("equal")
        axes.set_title(
            f"{band.band[0]:g} to {band.band[1]:g} mm, {height_text(band.allowed_rms)} rms", fontsize=9
        )
        axes.set_xlabel("x / mm")
        figure.colorbar(shown, ax=axes, label="dE / E in %", extend="max", shrink=0.8)
    panels[0].set_ylabel("y / mm")
    return png_bytes(figure)
