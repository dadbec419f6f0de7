"""The pictures of `thbcad trace` and of `thbcad verify --light` (matplotlib)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from optics.figures.canvas import plane_figure, plt, png_bytes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from optics.analysis import PhaseSpace
    from optics.photometry import Density
    from optics.target import Screen


def irradiance_figure(image: NDArray[np.float64], screen: Screen, density: Density) -> bytes:
    """Return the irradiance on the target's pixels as a picture.  image : in the stored unit of `density`."""
    unit, shown = screen.unit, density.factor * image
    label = f"{density.quantity} in {density.shown}"
    return plane_figure(shown, screen.half_width, unit, label, "gray", (0.0, float(shown.max())))


def phase_space_figure(sections: Mapping[str, tuple[PhaseSpace, float]]) -> bytes:
    """Return a picture of rays in phase space, (y, q), by planes; the colour is the position on the source.

    Equal areas stay equal where rays with x = p = 0 keep x and p, as behind a lens that is symmetric in x.

    sections : by the name of the plane, the source first: the rays and the greatest |y| that is shown, mm
    """
    figure, axes = plt.subplots(1, len(sections), figsize=(4.3 * len(sections), 4.0), layout="constrained")
    colour = next(iter(sections.values()))[0].points[1]
    for panel, (name, (section, widest)) in zip(axes, sections.items()):
        lit = section.flux > 0
        shown = panel.scatter(
            section.points[1][lit],
            section.points[3][lit],
            c=colour[lit],
            s=0.5,
            cmap="viridis",
            rasterized=True,
        )
        panel.set_xlim(-widest, widest)
        panel.set_xlabel("y / mm")
        panel.set_ylabel("q = n sin(angle to the axis)")
        panel.set_title(name, fontsize=10)
    figure.colorbar(shown, label="y on the source / mm")
    return png_bytes(figure)


def two_lights_figure(
    theirs: NDArray[np.float64], ours: NDArray[np.float64], screen: Screen, density: Density, name: str
) -> bytes:
    """Return a picture of two irradiances on a screen's pixels side by side, and of their difference.

    theirs, ours : in the stored unit of `density`.  name : of the program that made the first.
    """
    (hx, hy), unit = screen.half_width, screen.unit
    theirs, ours = density.factor * theirs, density.factor * ours
    off, peak = theirs - ours, float(max(theirs.max(), ours.max()))
    most = float(np.abs(off).max()) or 1.0
    panels = (
        (f"{name}, from the STEP file", theirs, "gray", (0.0, peak)),
        ("ours, from the lens", ours, "gray", (0.0, peak)),
        ("difference", off, "RdBu_r", (-most, most)),
    )
    figure, axes = plt.subplots(1, len(panels), figsize=(4.6 * len(panels), 4.0), layout="constrained")
    for panel, (title, image, colours, (low, high)) in zip(axes, panels):
        shown = panel.imshow(
            image, cmap=colours, vmin=low, vmax=high, extent=(-hx, hx, -hy, hy), interpolation="nearest"
        )
        panel.set_title(title, fontsize=10)
        panel.set_xlabel(f"x / {unit}")
        figure.colorbar(shown, ax=panel, label=density.shown, shrink=0.8)
    axes[0].set_ylabel(f"y / {unit}")
    return png_bytes(figure)
