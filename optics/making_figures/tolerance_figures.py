"""Pictures of tolerances: what each brings to the expected error, and how the worst change the light."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from optics.figures import new_figure, plane_figure, png_bytes

if TYPE_CHECKING:
    from optics.target import Screen
    from optics.tolerancing import ToleranceBudget, ToleranceEffect

MOST_BARS = 12  # what comes behind them brings next to nothing
CUT = 99.5  # per cent of the pixels within the scale: single ones would darken all others


def share_figure(budget: ToleranceBudget) -> bytes:
    """Draw the shares of the largest tolerances in the expected rise of rel_l2^2, as bars."""
    rows = list(budget.shares().items())[:MOST_BARS][::-1]
    amounts = {e.tolerance.name: e.tolerance for e in budget.effects}
    figure, axes = new_figure()
    figure.subplots_adjust(left=0.42)
    axes.barh([f"{name} (± {amounts[name].words})" for name, _ in rows], [100 * share for _, share in rows])
    axes.set_xlabel("share in the expected rise of rel_l2$^2$ / %")
    axes.tick_params(axis="y", labelsize=8)
    axes.grid(axis="x", alpha=0.3)
    return png_bytes(figure)


def change_figure(effect: ToleranceEffect, screen: Screen) -> bytes:
    """Draw the change of the light, scaled to unit mean, from the design to + amount of a tolerance."""
    change = effect.change
    most = float(np.percentile(np.abs(change), CUT)) or 1.0
    unit = "degrees" if screen.angular else "mm"
    label = f"change of E / mean E by {effect.tolerance.name} = + {effect.tolerance.words}"
    return plane_figure(change, screen.half_width, unit, label, "RdBu_r", (-most, most))
