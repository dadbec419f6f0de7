"""The light of a lens by the independent tracer, through the STEP file that is written and read back."""

from __future__ import annotations

from math import ceil, erf, exp, pi, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from optics.exchange.verification import trace_step
from optics.interface.api import System
from optics.scene.receivers import Screen
from optics.scene.sources import single_rays
from thbcad import Lens, read_step, write_step

Floats = NDArray[np.float64]

CUT = 4.0  # sigma: where the Gaussian ends, lowered by its value there (thesis 2.37)


def step_irradiance(system: System, lens: Lens, rays: tuple[int, int], sigma: float) -> Floats:
    """Return the irradiance through a lens's STEP file, by a Gaussian window, (rows, columns), W/mm^2.

    rays : of the source, in x and y, as the optimiser's model has them.  sigma : of the window, pixels.
    """
    with TemporaryDirectory() as folder:
        path = Path(folder) / "lens.step"
        write_step(lens, path)
        file = read_step(path)
    optical = system
    sent = single_rays(optical.source.rays(rays), lens)
    landing = trace_step(
        file, sent.origin.T, sent.direction.T, sent.flux, lens.index, optical.target.receiver
    )
    return gaussian_image(landing.points, landing.flux, optical.target.screen(), sigma)


def gaussian_image(points: Floats, flux: Floats, screen: Screen, sigma: float) -> Floats:
    """Return the irradiance of landing points by a Gaussian window of sigma pixels, (rows, columns), W/mm^2.

    points : (n, 2) mm, NaN where a ray does not land.  flux : (n,) W.
    """
    taps, (rows, columns) = 2 * ceil(CUT * sigma), screen.shape
    room = taps  # pixels around the image, for rays that land beside it
    maps = screen.pixel_map()
    with np.errstate(invalid="ignore"):  # NaN compares as beside
        where = [points[:, k] * maps[k][0] + maps[k][1] - screen.margin for k in (0, 1)]
        near = [(w > -taps / 2) & (w < n + taps / 2) for w, n in zip(where, (columns, rows))]
    on = near[0] & near[1]
    column, row = (w[on] for w in where)
    first = [np.floor(w - 0.5).astype(int) - taps // 2 + 1 for w in (column, row)]
    across, down = (_weights(w, f, taps, sigma) for w, f in zip((column, row), first))
    width = columns + 2 * room
    image = np.zeros((rows + 2 * room) * width)
    for j in range(taps):
        for k in range(taps):
            pixel = (first[1] + j + room) * width + first[0] + k + room
            image += np.bincount(pixel, flux[on] * down[j] * across[k], len(image))
    return image.reshape(-1, width)[room:-room, room:-room] / screen.pixel_area


def _weights(where: Floats, first: NDArray[np.int64], taps: int, sigma: float) -> Floats:
    """Return the weights of the pixels from `first` on for points of one coordinate, (taps, n)."""
    distance = first + np.arange(taps)[:, None] + 0.5 - where
    lowered = np.exp(-0.5 * (distance / sigma) ** 2) - exp(-0.5 * CUT**2)
    norm = sigma * (sqrt(2 * pi) * erf(CUT / sqrt(2)) - 2 * CUT * exp(-0.5 * CUT**2))
    return np.maximum(lowered, 0.0) / norm
