"""Fresnel's curves for the index of a lens, into the glass and out of it (thesis Figure 2.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from optics.figures.canvas import plt, png_bytes
from optics.tracing import critical_angle, traced_transmittance, transmittances

if TYPE_CHECKING:
    from optics.runtime import Backend

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
