"""The picture that a lens makes with the cusps of a tool, and what they cost in rel_l2.

Cusps are much finer than pixels on the lens, so that every small part of it holds all phases of a pass alike.
The light is therefore the mean over phases u from -1/2 to 1/2 of the light of lenses whose slopes are off by
u w, with the smooth field w of `thbcad.tools.Cusps.slopes`: traced exactly at the corners of cells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis import coloured, rel_l2, unit_mean
from optics.light.measuring import MappedCells
from optics.scene.paths import LightPath
from optics.scene.system import OpticalSystem
from optics.tolerancing.machining.response_to_slopes import Floats, crossings, slope_errors, traced_points
from thbcad.lens import Lens

CELLS_PER_PIXEL, LEAST_CELLS = 3, 257  # in each direction
PHASES_PER_PIXEL, LEAST_PHASES, MOST_PHASES = 2, 4, 32  # of the blur where it is widest


@dataclass(frozen=True, eq=False)
class CuspLight:
    """The picture with cusps, (rows, columns) of unit mean, and rel_l2 of the lens without and with them."""

    picture: Floats
    without: float
    with_cusps: float


def light_with_cusps(
    system: OpticalSystem,
    lens: Lens,
    backend: Backend,
    name: str,
    slopes: Callable[[Floats, Floats], Floats],
    widest: float,
) -> CuspLight | None:
    """Return the light of a lens whose "front" or "rear" has cusps; None for a source with extent.

    slopes : the range of slopes at positions x, y, (2, n).  widest : pixels, the greatest blur
    """
    if system.source.extended or system.blurred:
        return None
    screen = system.target.screen()
    colours = [
        (weight, _by_phase(system, path, backend, name, slopes))
        for weight, path in coloured(system, system.path(lens))
    ]

    def light(phase: float) -> Floats:
        return sum((weight * picture(phase) for weight, picture in colours), np.zeros(screen.shape))

    count = min(max(LEAST_PHASES, ceil(PHASES_PER_PIXEL * widest)), MOST_PHASES)
    picture = sum((light((k + 0.5) / count - 0.5) for k in range(count)), np.zeros(screen.shape))
    target = system.target.irradiance(screen, 1.0) / screen.projection()
    return CuspLight(unit_mean(picture), rel_l2(light(0.0), target), rel_l2(picture, target))


def _by_phase(
    system: OpticalSystem,
    path: LightPath,
    backend: Backend,
    name: str,
    slopes: Callable[[Floats, Floats], Floats],
) -> Callable[[float], Floats]:
    """Return the picture of one wavelength at a phase u: an irradiance, in the far field an intensity."""
    screen = system.target.screen()
    shown = screen.projection()
    cells = system.source.cells([max(LEAST_CELLS, CELLS_PER_PIXEL * n) for n in screen.pixels])
    rays = cells.rays()
    mapped = MappedCells(backend, screen, cells.emitted, rays.flux)
    field = slopes(*crossings(path, backend, name, rays))

    def light(phase: float) -> Floats:
        errors = slope_errors(name, phase * field if phase else None)
        points, flux = traced_points(path.with_slope_errors(errors), backend, rays)
        x, y, passing = map(backend.array, (*points, flux))
        with backend.dr.suspend_grad():
            image = mapped(x, y, passing, passing > 0).numpy()
        return np.asarray(image.reshape(screen.shape, order="F") / shown)

    return light
