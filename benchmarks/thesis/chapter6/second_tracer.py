"""The loss of a lens by a second tracer: numpy and scipy on the faces of its STEP file, at equal rays.

It stands for the thesis's commercial tracer (5.5).  Nothing of the optimiser's tracer is used.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from optics.exchange.verification import StepFile, trace_step
from optics.interface.api import System
from optics.light.tracing import LandingPoints
from optics.scene.receivers import Screen
from optics.scene.sources import single_rays
from thbcad import Lens, write_step

Floats = NDArray[np.float64]

CUT = 4.0  # sigma, of the Gaussian: there it is lowered to zero (2.37)
GRID = np.linspace(-CUT, CUT, 100_001)  # for the integral of the Gaussian, to 1e-10


def step_loss(system: System, lens: Lens, wanted: Floats, rays: tuple[int, int], sigma: float) -> float:
    """Return ||E - T|| / ||T|| of the lens's STEP file.

    wanted : T, (rows, columns), W/mm^2.  rays : of the source, as the optimiser takes them.
    sigma : of the Gaussian in which the light is measured, pixels.
    """
    optical = system
    bundle = single_rays(optical.source.rays(rays), lens)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "lens.step"
        write_step(lens, path)
        solid = StepFile(path).solid
        landing = trace_step(
            solid, bundle.origin.T, bundle.direction.T, bundle.flux, lens.index, optical.target.receiver
        )
    seen = gaussian_irradiance(landing, optical.target.screen(), sigma)
    return float(np.linalg.norm(seen - wanted) / np.linalg.norm(wanted))


def gaussian_irradiance(landing: LandingPoints, screen: Screen, sigma: float) -> Floats:
    """Return the irradiance in a Gaussian of sigma pixels, cut and lowered at CUT sigma, W/mm^2."""
    arrived = landing.flux > 0
    (scale_x, offset_x), (scale_y, offset_y) = screen.pixel_map()
    x, y = landing.points[arrived, 0] * scale_x + offset_x, landing.points[arrived, 1] * scale_y + offset_y
    reach = int(np.ceil(CUT * sigma))
    rows, columns = screen.shape
    image = np.zeros(rows * columns)
    first_x, first_y = np.floor(x - 0.5).astype(int), np.floor(y - 0.5).astype(int)
    steps = range(1 - reach, reach + 1)
    across = [_lowered(x - 0.5 - first_x - k, sigma) for k in steps]
    along = [_lowered(y - 0.5 - first_y - k, sigma) for k in steps]
    for i, wx in zip(steps, across):
        for j, wy in zip(steps, along):
            column, row = first_x + i, first_y + j
            on = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
            weight = (landing.flux[arrived] * wx * wy)[on]
            image += np.bincount((row * columns + column)[on], weight, rows * columns)
    return image.reshape(rows, columns) / screen.pixel_area


def _lowered(distance: Floats, sigma: float) -> Floats:
    """Return the lowered Gaussian at distances in pixels; its integral is 1."""
    t, least = distance / sigma, np.exp(-(CUT**2) / 2)
    area = sigma * np.trapezoid(np.exp(-(GRID**2) / 2) - least, GRID)
    return np.maximum(np.exp(-t * t / 2) - least, 0) / area
