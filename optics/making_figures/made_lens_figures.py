"""Pictures of made lenses: how their error is spread, and the light of a usual and of a bad one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from optics.analysis import unit_mean
from optics.figures import new_figure, new_panels, png_bytes

if TYPE_CHECKING:
    from optics.made_lenses import MonteCarlo

    Floats = np.ndarray

PARTS = {"median lens": 0.5, "95th percentile": 0.95}
BINS = 40
PANEL = (3.4, 3.4)  # inches
WHITE = 99.9  # per cent of the pixels of what is asked for that are not cut off
WORST = 99.0  # per cent of the lenses that a histogram shows, when some are far away


def made_lens_figures_of(made: MonteCarlo) -> list[tuple[str, bytes]]:
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
    highest = max(float(np.percentile(values, WORST)), made.limit) if values.size else made.limit
    axes.hist(100 * values, bins=BINS, range=(100 * made.budget.rel_l2 * 0.9, 110 * highest), color="C0")
    lines = {"design": made.budget.rel_l2, "limit": made.limit}
    lines |= {name: made.batch.quantile(part).value for name, part in PARTS.items()}
    for colour, (name, value) in zip(("k", "C3", "C1", "C2"), lines.items()):
        if np.isfinite(value):
            axes.axvline(100 * value, color=colour, label=f"{name}: {value:.2%}")
    axes.set_xlabel("rel_l2 / %")
    axes.set_ylabel("lenses")
    axes.legend(frameon=False, fontsize=8)
    return png_bytes(figure)


def lights_figure(made: MonteCarlo) -> bytes:
    """Draw the light asked for, of the design, and of the lenses of PARTS, at the same scale."""
    pictures = {"asked for": made.budget.target, "design": made.budget.irradiance}
    for name, part in PARTS.items():
        if not np.isfinite(made.batch.quantile(part).value):  # a lens that cannot be traced has no light
            continue
        pictures[name] = unit_mean(made.irradiance(part))
    figure, panels = new_panels(len(pictures), PANEL)
    hx, hy = made.model.system.target.screen().half_width
    most = float(np.percentile(made.budget.target, WHITE))
    for axes, (name, picture) in zip(panels, pictures.items()):
        axes.imshow(picture, cmap="gray", vmin=0, vmax=most, extent=(-hx, hx, -hy, hy))
        error = np.linalg.norm(picture - made.budget.target) / np.linalg.norm(made.budget.target)
        axes.set_title(name if name == "asked for" else f"{name}: rel_l2 {error:.1%}", fontsize=10)
        axes.set_axis_off()
    return png_bytes(figure)
