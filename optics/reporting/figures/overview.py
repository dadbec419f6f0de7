"""Target, irradiance and their difference in one figure, for scripts and notebooks (matplotlib).

pyplot and its choice of a backend are left alone: they belong to the script.
"""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from optics.light.analysis import Measurement, counted_ways
from optics.scene.system import OpticalSystem

SIZE, DPI = (11.0, 3.4), 80
SHOWN = (
    "rel_l2_debiased",
    "psnr_db",
    "ssim",
    "efficiency",
    "stray",
    "dof",
    "evaluations",
)  # metrics


class OverviewFigure(Figure):
    """A figure that a notebook shows by itself."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=DPI)
        return buffer.getvalue()


def overview_figure(system: OpticalSystem, measurement: Measurement) -> OverviewFigure:
    """Return target and irradiance on one scale, and their difference, all relative to the target's mean."""
    mean = measurement.target.mean()
    target, irradiance = measurement.target / mean, measurement.irradiance / mean
    error, top = irradiance - target, float(target.max())
    span = float(np.quantile(np.abs(error), 0.999)) or 1.0
    hx, hy = system.target.settings.half_width
    unit = system.target.unit
    figure = OverviewFigure(figsize=SIZE, layout="constrained")
    pictures = (
        ("asked for", target, "gray", 0.0, top),
        (f"made ({counted_ways(measurement.metrics)})", irradiance, "gray", 0.0, top),
        ("difference", error, "RdBu_r", -span, span),
    )
    for axes, (title, data, colours, low, high) in zip(figure.subplots(1, 3), pictures):
        image = axes.imshow(data, cmap=colours, vmin=low, vmax=high, extent=(-hx, hx, -hy, hy))
        axes.set_title(title)
        axes.set_xlabel(f"x / {unit}")
        figure.colorbar(image, ax=axes, shrink=0.8)
    return figure


def overview_html(
    system: OpticalSystem, measurement: Measurement, metrics: Mapping[str, Any], notes: Sequence[str]
) -> str:
    """Return the figure with the main numbers below it, as HTML."""
    png = b64encode(overview_figure(system, measurement)._repr_png_()).decode()
    numbers = {name: metrics[name] for name in SHOWN if metrics.get(name) is not None}
    cells = "".join(f"<td><b>{name}</b> {value:.4g}</td>" for name, value in numbers.items())
    said = "".join(f"<li>{escape(sentence)}</li>" for sentence in notes)
    return (
        f"<b>{escape(system.problem.title)}</b><br>"
        f'<img src="data:image/png;base64,{png}" style="max-width:100%"><table><tr>{cells}</tr></table>'
        + (f"<ul>{said}</ul>" if said else "")
    )
