"""Fresnel's curves for the index of a lens, into the glass and out of it (thesis Figure 2.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from optics.report.figures import plt, png_bytes
from optics.tracing import critical_angle, traced_transmittance, transmittances

if TYPE_CHECKING:
    from optics.runtime import Backend

STEPS = 1800  # of the angle, 0.05 degrees


def fresnel_figure(backend: Backend, index: float) -> bytes:
    """Return the transmittances T_s, T_p and T_u against the angle of incidence as a picture; T_u is the
    tracer's own.

    index : of the lens, in air.
    """
    degrees = np.linspace(0, 90, STEPS, endpoint=False)
    figure, axes = plt.subplots(1, 2, figsize=(8.6, 3.8), sharey=True, layout="constrained")
    for own, before, behind in zip(axes, (1.0, index), (index, 1.0)):
        angle = np.radians(degrees)
        senkrecht, parallel = transmittances(before, behind, angle)
        own.plot(degrees, senkrecht, "--", lw=1.1, label="$T_s$")
        own.plot(degrees, parallel, "-.", lw=1.1, label="$T_p$")
        own.plot(
            degrees, traced_transmittance(backend, before, behind, angle), "k", lw=1.4, label="$T_u$, traced"
        )
        critical = critical_angle(before, behind)
        title = f"{'into' if critical is None else 'out of'} the lens, {before:g} to {behind:g}"
        if critical is not None:
            own.axvline(np.degrees(critical), color="0.6", lw=0.8, ls=":")
            title += f"; total reflection from {np.degrees(critical):.2f} degrees on"
        own.set_title(title, fontsize=9)
        own.set_xlabel("angle of incidence / degrees")
        own.set_xlim(0, 90)
        own.set_xticks(range(0, 91, 15))
        own.set_ylim(0, 1.02)
        own.grid(alpha=0.3)
    axes[0].set_ylabel("transmittance")
    axes[0].legend(frameon=False)
    return png_bytes(figure)
