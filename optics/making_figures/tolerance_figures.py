"""Pictures of tolerances: how much of what is allowed each takes, and how the worst change the light."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from optics.figures import new_figure, plane_figure, png_bytes

if TYPE_CHECKING:
    from optics.target import Screen
    from optics.tolerancing import ToleranceBudget, ToleranceEffect

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
