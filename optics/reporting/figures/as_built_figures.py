"""Pictures of a lens as it was made: its error of height, and its light beside that of the design."""

from __future__ import annotations

import numpy as np

from optics.light.analysis import unit_mean
from optics.reporting.figures.canvas import new_panels, plane_figure, png_bytes
from optics.reporting.figures.overview import draw_pictures
from optics.scene.receivers import Screen
from optics.tolerancing.metrology import AsBuilt

PIXELS = 256  # along the longer side: finer than the waves that 10^5 points resolve
NANOMETRES, MICROMETRES = 1e6, 1e3  # of a millimetre
SMALL = 1e-3  # mm: smaller errors are shown in nm
CUT = 99.8  # per cent of the pixels within the scale of the change: single ones would darken all others
PANEL = (4.0, 4.2)  # inches


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
