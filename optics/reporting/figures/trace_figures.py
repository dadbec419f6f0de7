"""The pictures of `thbcad trace` and `verify --light`, and Fresnel's curves (thesis 2.3)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import Backend
from optics.light.analysis import PhaseSpace
from optics.light.tracing import critical_angle, traced_transmittance, transmittances
from optics.reporting.figures.canvas import plane_figure, plt, png_bytes
from optics.reporting.figures.overview import draw_pictures
from optics.scene.photometry import Density
from optics.scene.receivers import Screen


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
    theirs, ours = density.factor * theirs, density.factor * ours
    off, peak = theirs - ours, float(max(theirs.max(), ours.max()))
    most = float(np.abs(off).max()) or 1.0
    panels = (
        (f"{name}, from the STEP file", theirs, "gray", 0.0, peak),
        ("ours, from the lens", ours, "gray", 0.0, peak),
        ("difference", off, "RdBu_r", -most, most),
    )
    figure, axes = plt.subplots(1, len(panels), figsize=(4.6 * len(panels), 4.0), layout="constrained")
    for panel, shown in zip(axes, draw_pictures(axes, panels, screen.half_width, screen.unit)):
        figure.colorbar(shown, ax=panel, label=density.shown, shrink=0.8)
    return png_bytes(figure)


STEPS = 1800  # of the angle, 0.05 degrees


def fresnel_figure(backend: Backend, index: float) -> bytes:
    """Return the transmittances T_s, T_p and T_u by the angle of incidence as a picture.

    T_u, of unpolarised light, comes from the tracer.

    index : of the lens, in air
    """
    degrees = np.linspace(0, 90, STEPS, endpoint=False)
    figure, axes = plt.subplots(1, 2, figsize=(8.6, 3.8), sharey=True, layout="constrained")
    for panel, before, behind in zip(axes, (1.0, index), (index, 1.0)):
        angle = np.radians(degrees)
        s_polarised, p_polarised = transmittances(before, behind, angle)
        panel.plot(degrees, s_polarised, "--", lw=1.1, label="$T_s$")
        panel.plot(degrees, p_polarised, "-.", lw=1.1, label="$T_p$")
        panel.plot(
            degrees, traced_transmittance(backend, before, behind, angle), "k", lw=1.4, label="$T_u$, traced"
        )
        critical = critical_angle(before, behind)
        title = f"{'into' if critical is None else 'out of'} the lens, {before:g} to {behind:g}"
        if critical is not None:
            panel.axvline(np.degrees(critical), color="0.6", lw=0.8, ls=":")
            title += f"; total reflection from {np.degrees(critical):.2f} degrees on"
        panel.set_title(title, fontsize=9)
        panel.set_xlabel("angle of incidence / degrees")
        panel.set_xlim(0, 90)
        panel.set_xticks(range(0, 91, 15))
        panel.set_ylim(0, 1.02)
        panel.grid(alpha=0.3)
    axes[0].set_ylabel("transmittance")
    axes[0].legend(frameon=False)
    return png_bytes(figure)
