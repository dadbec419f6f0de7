"""Pictures of tolerances, form errors and lenses made within them: what each costs, and their light."""

import numpy as np

from optics.light.analysis import unit_mean
from optics.reporting.figures.canvas import new_figure, new_panels, plane_figure, png_bytes
from optics.reporting.figures.overview import draw_pictures
from optics.scene.receivers import Screen
from optics.tolerancing.form_errors import FormErrors, SideCost, height_text
from optics.tolerancing.monte_carlo_samples import MonteCarlo
from optics.tolerancing.perturbations import ToleranceBudget, ToleranceEffect

Figures = dict[str, tuple[str, bytes]]  # (caption, PNG) by name

MOST_BARS = 12  # what comes behind them costs next to nothing
CUT = 99.5  # per cent of the pixels within the scale: single ones would darken all others


def cost_figure(budget: ToleranceBudget) -> bytes:
    """Draw the amounts of the costliest tolerances in allowed ones, as bars."""
    rows = [e for e in budget.by_cost() if 0 < e.cost < np.inf][:MOST_BARS][::-1]
    figure, axes = new_figure()
    figure.subplots_adjust(left=0.42)
    names = [f"{e.tolerance.name} (± {e.tolerance.words})" for e in rows]
    axes.barh(names, [100 * e.cost for e in rows])
    axes.axvline(100, color="C3", linewidth=1)
    axes.set_xlabel("amount / allowed amount / %")
    axes.tick_params(axis="y", labelsize=8)
    axes.grid(axis="x", alpha=0.3)
    return png_bytes(figure)


def change_figure(effect: ToleranceEffect, screen: Screen) -> bytes:
    """Draw the change of the light, scaled to unit mean, from the design to + amount of a tolerance."""
    change = effect.change
    most = float(np.percentile(np.abs(change), CUT)) or 1.0
    unit = screen.unit
    label = f"change of E / mean E by {effect.tolerance.name} = + {effect.tolerance.words}"
    return plane_figure(change, screen.half_width, unit, label, "RdBu_r", (-most, most))


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
    axes.set(xlabel="period / mm", ylabel="allowed height error / nm")
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
        shown = axes.pcolormesh(  # at the points themselves, which need not stand in a grid
            x, y, percent, vmin=0.0, vmax=top, cmap="magma", rasterized=True, shading="gouraud"
        )
        axes.set_aspect("equal")
        axes.set_title(
            f"{band.band[0]:g} to {band.band[1]:g} mm, {height_text(band.allowed_rms)} rms", fontsize=9
        )
        axes.set_xlabel("x / mm")
        figure.colorbar(shown, ax=axes, label="dE / E in %", extend="max", shrink=0.8)
    panels[0].set_ylabel("y / mm")
    return png_bytes(figure)


PARTS = {"median lens": 0.5, "95th percentile": 0.95}
BINS = 40
LIGHT_PANEL = (3.4, 3.4)  # inches
WHITE = 99.9  # per cent of the pixels of what is asked for that are not cut off
WORST = 99.0  # per cent of the lenses that a histogram shows, when some are far away


def monte_carlo_figures_of(made: MonteCarlo) -> list[tuple[str, bytes]]:
    """Return (caption, PNG) of the figures of a Monte Carlo."""
    names = ", ".join(PARTS)
    return [
        ("rel_l2 of made lenses", spread_figure(made)),
        (f"light asked for, of the design, and of made lenses: {names}", lights_figure(made)),
    ]


def spread_figure(made: MonteCarlo) -> bytes:
    """Draw the distribution of rel_l2, with the design, the limit and the quantiles."""
    values = made.batch.rel_l2[np.isfinite(made.batch.rel_l2)]
    figure, axes = new_figure()
    limit = made.budget.bounds.get("rel_l2", made.budget.rel_l2)
    highest = max(float(np.percentile(values, WORST)), limit) if values.size else limit
    axes.hist(100 * values, bins=BINS, range=(100 * made.budget.rel_l2 * 0.9, 110 * highest), color="C0")
    lines = {"design": made.budget.rel_l2} | ({"limit": limit} if "rel_l2" in made.budget.bounds else {})
    lines |= {name: made.batch.quantile(part).value for name, part in PARTS.items()}
    for colour, (name, value) in zip(("k", "C3", "C1", "C2"), lines.items()):
        if np.isfinite(value):
            axes.axvline(100 * value, color=colour, label=f"{name}: {value:.2%}")
    axes.set(xlabel="rel_l2 / %", ylabel="lenses")
    axes.legend(frameon=False, fontsize=8)
    return png_bytes(figure)


def lights_figure(made: MonteCarlo) -> bytes:
    """Draw the light asked for, of the design, and of the lenses of PARTS, at the same scale."""
    target = made.budget.target
    most = float(np.percentile(target, WHITE))
    lights = {"design": made.budget.irradiance}
    for name, part in PARTS.items():
        if np.isfinite(made.batch.quantile(part).value):  # a lens that cannot be traced has no light
            lights[name] = unit_mean(made.irradiance(part))
    pictures = [("asked for", target, "gray", 0.0, most)]
    for name, light in lights.items():
        error = np.linalg.norm(light - target) / np.linalg.norm(target)
        pictures.append((f"{name}: rel_l2 {error:.1%}", light, "gray", 0.0, most))
    figure, panels = new_panels(len(pictures), LIGHT_PANEL)
    draw_pictures(panels, pictures, made.model.system.target.screen().half_width, interpolation=None)
    for axes in panels:
        axes.set_axis_off()
    return png_bytes(figure)
