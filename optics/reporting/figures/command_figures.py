"""The pictures of `thbcad etendue`, `relight`, `asbuilt`, `trace` and `verify --light`, and Fresnel's curves
(thesis 2.3; matplotlib).
"""

from collections.abc import Mapping

import numpy as np

from optics.base.runtime import Backend
from optics.designing.etendue import ImageBound, UniversalBound
from optics.light.analysis import Measurement, PhaseSpace, unit_mean
from optics.light.tracing import critical_angle, traced_transmittance, transmittances
from optics.reporting.figures.canvas import new_panels, plane_figure, plt, png_bytes
from optics.reporting.figures.overview import draw_pictures
from optics.scene.photometry import Density
from optics.scene.receivers import Screen
from optics.tolerancing.metrology import AsBuilt
from thbcad.checks import Floats

PIXELS = 256  # along the longer side: finer than the waves that 10^5 points resolve
NANOMETRES, MICROMETRES = 1e6, 1e3  # of a millimetre
SMALL = 1e-3  # mm: smaller errors are shown in nm
CUT = 99.8  # per cent of the pixels within the scale of the change: single ones would darken all others
PANEL = (4.0, 4.2)  # inches
STEPS = 1800  # of the angle, 0.05 degrees


def height_error_figure(built: AsBuilt) -> bytes:
    """Draw made - designed height over the surface, as it was fitted."""
    half_width = built.made.surface.half_width
    longest = max(half_width)
    counts = [max(2, round(PIXELS * h / longest)) for h in half_width]
    x, y = (h * (2 * np.arange(n) + 1 - n) / n for h, n in zip(half_width, counts))
    heights = built.made.surface.grid(x, y[::-1]).T - built.made.designed.grid(x, y[::-1]).T
    most = float(np.abs(heights).max()) or 1e-9
    unit, factor = ("nm", NANOMETRES) if most < SMALL else ("µm", MICROMETRES)
    limits = -factor * most, factor * most
    return plane_figure(factor * heights, half_width, "mm", f"made - designed / {unit}", "RdBu_r", limits)


def made_light_figure(built: AsBuilt, screen: Screen) -> bytes:
    """Draw the light asked for, as designed, as made, on one scale, and the change from design to made."""
    designed, made = built.nominal, built.measurement
    mean, asked = float(designed.irradiance.mean()) or 1.0, unit_mean(designed.target)
    top, change = float(asked.max()), built.change / mean
    most = float(np.percentile(np.abs(change), CUT)) or 1.0
    as_designed, fitted = (f"rel_l2 {one.metrics['rel_l2']:.3f}" for one in (designed, made))
    pictures = [
        ("asked for", asked, "gray", 0.0, top),
        (f"as designed: {as_designed}", designed.irradiance / mean, "gray", 0.0, top),
        (f"fitted lens: {fitted}", made.irradiance / mean, "gray", 0.0, top),
        ("made - designed", change, "RdBu_r", -most, most),
    ]
    figure, axes = new_panels(len(pictures), PANEL)
    for panel, shown in zip(axes, draw_pictures(axes, pictures, screen.half_width, screen.unit)):
        figure.colorbar(shown, ax=panel, location="bottom", label="light / mean")
    return png_bytes(figure)


def bound_figure(universal: UniversalBound, bound: ImageBound, screen: Screen) -> bytes:
    """Draw the target irradiance, the best irradiance of one blur and its image of the source, and the least
    rel_l2 of any lens over its efficiency.

    The pictures have the same scale.
    """
    top = float(bound.target.max())
    # the image of the source in the middle of the target
    rows, columns = bound.target.shape
    k, l = bound.kernel.shape
    source = np.zeros(bound.target.shape)
    r, c = (rows - k) // 2, (columns - l) // 2
    source[r : r + k, c : c + l] = bound.kernel / bound.kernel.max()
    one_blur = f"one blur everywhere: {bound.attained:.1%} off, at least {bound.lower_bound:.1%}"
    named = [("asked for", bound.target / top), (one_blur, bound.image / top), ("that blur", source)]
    pictures = [(title, image, "gray", 0.0, 1.0) for title, image in named]
    figure, axes = plt.subplots(1, 4, figsize=(17, 4.2), layout="constrained")
    shown = draw_pictures(axes, pictures, screen.half_width, screen.unit)
    figure.colorbar(shown[-1], ax=list(axes[:3]), label="light / brightest asked for")
    points = [(efficiency, least) for efficiency, least in universal.curve() if least is not None]
    axes[3].plot([e for e, _ in points], [least for _, least in points], marker="o")
    axes[3].set(
        xlim=(0, 1.02), xlabel="efficiency", ylabel="rel_l2", title="least of any lens in the envelope"
    )
    return png_bytes(figure)


def relit_figure(designed: Measurement, other: Measurement, screen: Screen, words: str) -> bytes:
    """Draw three pictures over their means, on one scale.

    words : for the other light.
    """
    named = [
        ("asked for", designed.target),
        (f"as designed: rel_l2 {designed.metrics['rel_l2']:.3f}", designed.irradiance),
        (f"{words}: rel_l2 {other.metrics['rel_l2']:.3f}", other.irradiance),
    ]
    top = float(unit_mean(designed.target).max())
    pictures = [(title, unit_mean(image), "gray", 0.0, top) for title, image in named]
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.4), layout="constrained")
    shown = draw_pictures(axes, pictures, screen.half_width, screen.unit)
    figure.colorbar(shown[-1], ax=list(axes), label="light / mean")
    return png_bytes(figure)


def irradiance_figure(image: Floats, screen: Screen, density: Density) -> bytes:
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
        panel.set(xlim=(-widest, widest), xlabel="y / mm", ylabel="q = n sin(angle to the axis)")
        panel.set_title(name, fontsize=10)
    figure.colorbar(shown, label="y on the source / mm")
    return png_bytes(figure)


def two_lights_figure(theirs: Floats, ours: Floats, screen: Screen, density: Density, name: str) -> bytes:
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
        panel.set(
            xlabel="angle of incidence / degrees", xlim=(0, 90), xticks=range(0, 91, 15), ylim=(0, 1.02)
        )
        panel.grid(alpha=0.3)
    axes[0].set_ylabel("transmittance")
    axes[0].legend(frameon=False)
    return png_bytes(figure)
