"""Pictures of light side by side, of a level of a design in a row, and of a design in one figure for scripts
and notebooks (matplotlib).

pyplot and its choice of a backend are left alone: they belong to the script.
"""

import io
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from optics.light.analysis import Measurement, counted_ways
from optics.reporting.figures.canvas import new_panels, png_bytes
from optics.scene.system import System
from thbcad.checks import Floats
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface

# title, light, colours, and the ends of their scale
Picture = tuple[str, NDArray[np.floating[Any]], str, float, float]

SIZE, DPI = (11.0, 3.4), 80
SHOWN = ("rel_l2_debiased", "psnr_db", "ssim", "efficiency", "stray", "dof", "evaluations")  # metrics
PANEL = (3.6, 3.2)  # inches, of a picture
DECADES = 3  # of the colours of gradients


def relative_light(measurement: Measurement) -> tuple[Floats, Floats, Floats, float]:
    """Return target and irradiance over the target's mean, their difference, and where its scale ends."""
    mean = measurement.target.mean()
    target, irradiance = measurement.target / mean, measurement.irradiance / mean
    error = irradiance - target
    return target, irradiance, error, float(np.quantile(np.abs(error), 0.999)) or 1.0


def draw_pictures(
    axes: Sequence[Axes],
    pictures: Iterable[Picture],
    half_width: tuple[float, float],
    unit: str = "",
    fontsize: float | str = 10,
    interpolation: str | None = "nearest",
) -> list[AxesImage]:
    """Draw pictures of light over the same rectangle side by side, row 0 at +y; return what has a scale.

    unit : of x and y beside the axes, "" for none.  fontsize : of the titles.
    """
    (hx, hy), shown = half_width, []
    for panel, (title, image, colours, low, high) in zip(axes, pictures):
        extent = (-hx, hx, -hy, hy)
        shown.append(
            panel.imshow(image, colours, vmin=low, vmax=high, extent=extent, interpolation=interpolation)
        )
        panel.set_title(title, fontsize=fontsize)
        if unit:
            panel.set_xlabel(f"x / {unit}")
    if unit:
        axes[0].set_ylabel(f"y / {unit}")
    return shown


class OverviewFigure(Figure):
    """A figure that a notebook shows by itself."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=DPI)
        return buffer.getvalue()


def overview_figure(system: System, measurement: Measurement) -> OverviewFigure:
    """Return target and irradiance on one scale, and their difference, all relative to the target's mean."""
    target, irradiance, error, span = relative_light(measurement)
    top = float(target.max())
    figure = OverviewFigure(figsize=SIZE, layout="constrained")
    pictures = (
        ("asked for", target, "gray", 0.0, top),
        (f"made ({counted_ways(measurement.metrics)})", irradiance, "gray", 0.0, top),
        ("difference", error, "RdBu_r", -span, span),
    )
    panels, half_width = figure.subplots(1, 3), system.target.settings.half_width
    shown = draw_pictures(panels, pictures, half_width, fontsize="large", interpolation=None)
    for panel, image in zip(panels, shown):
        panel.set_xlabel(f"x / {system.target.unit}")
        figure.colorbar(image, ax=panel, shrink=0.8)
    return figure


def overview_html(
    system: System, measurement: Measurement, metrics: Mapping[str, Any], notes: Sequence[str]
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


def level_figure(
    system: System, name: str, measurement: Measurement, gradients: Sequence[Floats]
) -> tuple[str, bytes]:
    """Return (caption, PNG) of a level: its light, the error of it, and the mesh coloured by gradients.

    gradients : sums of |dL/dz| of the vertices over every leaf cell, of every free surface, front first.
    """
    lens = system.designed
    name_of = system.problem.optic.face_name
    free = [(name_of(s), f) for s, f, _ in lens.faces if f.sag is not None]
    figure, axes = new_panels(2 + len(free), PANEL)
    target, irradiance, error, span = relative_light(measurement)
    pictures = (
        ("light / mean", irradiance, "gray", 0.0, float(target.max())),
        ("error", error, "RdBu_r", -span, span),
    )
    half_width = system.target.settings.half_width
    shown = draw_pictures(axes, pictures, half_width, fontsize="large", interpolation=None)
    for plane, image in zip(axes, shown):
        figure.colorbar(image, ax=plane, shrink=0.8)
    for plane, (side, surface), gradient in zip(axes[2:], free, gradients):
        _mesh(plane, surface, gradient)
        plane.set_title(f"{side}: |dL/dz| per area")
    several = len(system.problem.free_optics) > 1
    dof = f"{sum(sag.space.dim for sag in lens.sags)} degrees of freedom"
    of = f" of {system.problem.optic.called}" if several else ""
    caption = f"{name}: {dof}{of}, relative error {measurement.metrics['rel_l2']:.4f}."
    return caption, png_bytes(figure)


def cell_corners(space: THBSpace, half_width: tuple[float, float]) -> Floats:
    """Return the corners of the leaf cells of a space over a rectangle, counter-clockwise, (cells, 4, 2)."""
    (x0, x1), (y0, y1) = (
        h * (2 * (space.boxes.T[2 * d : 2 * d + 2] - kv.start) / (kv.stop - kv.start) - 1)
        for d, (h, kv) in enumerate(zip(half_width, (space.kv_u, space.kv_v)))
    )
    return np.stack([x0, y0, x1, y0, x1, y1, x0, y1], 1).reshape(-1, 4, 2)


def _mesh(axes: Axes, surface: FreeformSurface, gradient: Floats) -> None:
    """Draw the leaf cells coloured by gradient per area, relative to the greatest."""
    assert surface.sag is not None
    space, (hx, hy) = surface.sag.space, surface.half_width
    corners = cell_corners(space, surface.half_width)
    density = gradient / (corners[:, 2] - corners[:, 0]).prod(axis=1)
    greatest = float(density.max()) or 1.0
    cells = PolyCollection(
        list(corners), cmap="viridis", norm=LogNorm(10.0**-DECADES, 1.0), edgecolors="0.5", linewidths=0.15
    )
    cells.set_array(np.maximum(density / greatest, 10.0**-DECADES))
    axes.add_collection(cells)
    axes.set(xlim=(-hx, hx), ylim=(-hy, hy), aspect="equal")
