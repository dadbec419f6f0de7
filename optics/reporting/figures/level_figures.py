"""A row of pictures of one level of a design (matplotlib)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm
from numpy.typing import NDArray

from optics.light.analysis import Measurement
from optics.reporting.figures.canvas import plt, png_bytes
from optics.reporting.figures.overview import draw_pictures, relative_light
from optics.scene.system import OpticalSystem
from thbcad.lens import FreeformSurface, Lens

WIDE, HIGH = 3.6, 3.2  # inches, of a picture
DECADES = 3  # of the colours of gradients


def level_figure(
    system: OpticalSystem,
    name: str,
    lens: Lens,
    measurement: Measurement,
    gradients: Sequence[NDArray[np.float64]],
) -> tuple[str, bytes]:
    """Return (caption, PNG) of a level: its light, the error of it, and the mesh coloured by gradients.

    gradients : sums of |dL/dz| of the vertices over every leaf cell, of every free surface, front first.
    """
    name_of = system.problem.optic.face_name
    free = [(name_of(s), f) for s, f in (("front", lens.front), ("rear", lens.rear)) if f.sag is not None]
    figure, axes = plt.subplots(
        1, 2 + len(free), figsize=(WIDE * (2 + len(free)), HIGH), layout="constrained"
    )
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
    dof = sum(sag.space.dim for sag in lens.sags)
    caption = f"{name}: {dof} degrees of freedom, relative error {measurement.metrics['rel_l2']:.4f}."
    return caption, png_bytes(figure)


def _mesh(axes: Axes, surface: FreeformSurface, gradient: NDArray[np.float64]) -> None:
    """Draw the leaf cells coloured by gradient per area, relative to the greatest."""
    assert surface.sag is not None
    space, (hx, hy) = surface.sag.space, surface.half_width
    (x0, x1), (y0, y1) = (
        h * (2 * (space.boxes.T[2 * d : 2 * d + 2] - kv.start) / (kv.stop - kv.start) - 1)
        for d, (h, kv) in enumerate(((hx, space.kv_u), (hy, space.kv_v)))
    )
    corners = np.stack([x0, y0, x1, y0, x1, y1, x0, y1], 1).reshape(-1, 4, 2)
    density = gradient / ((x1 - x0) * (y1 - y0))
    greatest = float(density.max()) or 1.0
    cells = PolyCollection(
        list(corners), cmap="viridis", norm=LogNorm(10.0**-DECADES, 1.0), edgecolors="0.5", linewidths=0.15
    )
    cells.set_array(np.maximum(density / greatest, 10.0**-DECADES))
    axes.add_collection(cells)
    axes.set_xlim(-hx, hx)
    axes.set_ylim(-hy, hy)
    axes.set_aspect("equal")
