"""Pictures of form errors: what a shop must hold against the period, and where on the lens (matplotlib)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.figures import new_panels, png_bytes

if TYPE_CHECKING:
    from collections.abc import Sequence

    Floats = NDArray[np.float64]

NM = 1e6  # per mm


def allowed_figure(bands: Sequence[tuple[float, float]], rms: Sequence[float], pv: Sequence[float]) -> bytes:
    """Return the allowed rms and peak to valley of a form error against its period as a picture.

    bands : of the period, mm.  rms, pv : of each band, mm.
    """
    figure, (axes,) = new_panels(1)
    for values, label in ((pv, "peak to valley"), (rms, "rms")):
        edges = np.array(bands).ravel()
        axes.loglog(edges, np.repeat(NM * np.asarray(values), 2), label=label)
    axes.set_xlabel("period / mm")
    axes.set_ylabel("allowed height error / nm")
    axes.grid(alpha=0.3, which="both")
    axes.legend(frameon=False)
    return png_bytes(figure)
