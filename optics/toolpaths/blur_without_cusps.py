"""How wide the light of one point of a lens is on the target without any cusps: the yardstick for theirs."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from optics.blur import blur_of
from optics.toolpaths.response_to_slopes import crossings, traced_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from optics.runtime import Backend
    from optics.system import OpticalSystem
    from thbcad.lens import Lens

    Floats = NDArray[np.float64]

RAYS = 257  # in each direction, of an extended source
PLACES = 12  # in each direction, on the rear: 450 rays each
LEAST_RAYS = 20  # of a place
EVEN_WIDTH = sqrt(12)  # of an even spot, in its standard deviation


def present_blur(system: OpticalSystem, lens: Lens, backend: Backend) -> float:
    """Return the full width of the spot of one point of the rear, mm (degrees in the far field); 0 if sharp.

    That of a beam's divergence and rough surfaces, see `optics.blur.Blur.width`.  Of an extended source it is
    the median over places of the rear of sqrt(12) times the standard deviation of landing points there, less
    what is linear in the position.
    """
    if system.blurred:
        return blur_of(system, lens, backend).width
    if not system.source.extended:
        return 0.0
    rays = system.source.rays((RAYS, RAYS))
    at = np.stack(crossings(system, lens, backend, "rear", rays))
    points, flux = traced_points(system, lens, backend, rays)
    column, row = (
        np.minimum((PLACES * (a + h) / (2 * h)).astype(int), PLACES - 1)
        for a, h in zip(at, lens.rear.half_width)
    )
    place = np.where(flux > 0, column * PLACES + row, -1)
    widths = [
        _width(at[:, place == k], points[:, place == k])
        for k in range(PLACES**2)
        if (place == k).sum() >= LEAST_RAYS
    ]
    return float(np.median(widths)) if widths else 0.0


def _width(at: Floats, points: Floats) -> float:
    """Return the width of landing points, (2, n), less what is linear in the position, (2, n)."""
    known = np.stack([np.ones(at.shape[1]), *at], axis=1)
    left = points.T - known @ np.linalg.lstsq(known, points.T, rcond=None)[0]
    return float(EVEN_WIDTH * np.sqrt(np.mean(np.square(left))))
