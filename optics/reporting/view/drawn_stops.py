"""Stops as thin plates in pictures: their rims."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from optics.scene.paths import Stop
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens
from thbcad.outlines import Outline

Array = NDArray[np.float64]

AROUND = 1.25  # half-widths of a hole, or of the lens: so large plates without end are drawn
POINTS = 65  # of an ellipse


def stop_rims(system: OpticalSystem, lens: Lens) -> list[list[Array]]:
    """Return the rims of every stop, (3, n) each, mm: the outer one first, each the other way round."""
    hx, hy = (max(pair) for pair in zip(lens.front.half_width, lens.rear.half_width))
    return [_rims(stop, (hx, hy)) for stop in system.stops]


def _rims(stop: Stop, size: tuple[float, float]) -> list[Array]:
    outlines = [stop.outline] if stop.inner is None else [stop.outline, stop.inner]
    if stop.hole:
        hx, hy = (AROUND * max(pair) for pair in zip(size, stop.outline.half_width))
        outlines = [Outline((hx, hy)), *outlines]
    rims = [stop.pose.points(_rim(outline)) for outline in outlines]
    return [rim[:, :: -1 if k % 2 else 1] for k, rim in enumerate(rims)]


def _rim(outline: Outline) -> Array:
    """Return points along a rectangle or an ellipse, in its plane, (3, n)."""
    hx, hy = outline.half_width
    if outline.is_rectangle:
        return np.array([[-hx, hx, hx, -hx], [-hy, -hy, hy, hy], [0.0] * 4])
    angle = np.linspace(0, 2 * np.pi, POINTS)
    return np.stack([hx * np.cos(angle), hy * np.sin(angle), np.zeros(POINTS)])
