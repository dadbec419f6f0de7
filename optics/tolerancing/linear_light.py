"""What a perturbation does to the light, from the derivatives of the landing points.

Landing points and flux of the corners of cells are smooth in the amount a of a perturbation,

    L(a) = L + a L' + a^2 L'' / 2 + O(a^3),

with L' and L'' by symmetric differences of exact traces.  Mapped cells carry them to exact irradiance.
Irradiance itself is not smooth in a: bright lines that are finer than a pixel pass the borders of pixels.
Its derivative, which mapped cells have too,

    dE = J p = T(L; L'),

is right for amounts that move light by hundredths of a pixel, where the light has such lines.

Cells that a rim cuts, and rays, have neither.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.sources import corner_flux
from optics.target import MappedCells
from optics.tolerancing.perturbation import NOMINAL, Floats, Perturbation
from optics.tolerancing.traced_light import CORNERS_AT_ONCE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from optics.sources import SourceCells
    from optics.tolerancing.traced_light import PerturbedLight, Trace

STEP = 0.5  # of the perturbation, for differences: as far as that, third derivatives jump between knot spans


class LinearLight:
    """What perturbations do to the light of one lens, by derivatives of the landing points.

    irradiance : (rows, columns), of the design.
    """

    def __init__(self, light: PerturbedLight) -> None:
        self._light = light
        self.irradiance, self.fates = light(NOMINAL)
        self._here = list(self._corners(NOMINAL)) if light.by_cells else []

    def derivative(self, perturbation: Perturbation) -> Floats | None:
        """Return dE = J p, (rows, columns); None of rays, and where a rim cuts cells."""
        return self._of_moves(perturbation, self._pushed)

    def moved(self, perturbation: Perturbation) -> Floats | None:
        """Return the light of landing points L + L' + L''/2, (rows, columns); None as of `derivative`."""
        return self._of_moves(perturbation, self._pictured)

    def _of_moves(
        self,
        perturbation: Perturbation,
        image: Callable[[_Corners, Floats, Floats, NDArray[np.bool_]], Floats],
    ) -> Floats | None:
        """Return the sum of images of corners with L' and L'', where no cell is cut."""
        light = self._light
        if not light.by_cells:
            return None
        total = np.zeros(light.screen.shape)
        steps = (self._corners(sign * STEP * perturbation) for sign in (1, -1))
        for here, ahead, behind in zip(self._here, *steps):
            sound = here.sound & ahead.sound & behind.sound
            if _cut(sound, here.cells.emitted):
                return None
            rate = (ahead.jet - behind.jet) / (2 * STEP)
            bend = (ahead.jet + behind.jet - 2 * here.jet) / STEP**2
            total += here.weight / light.screen.projection() * image(here, rate, bend, sound)
        return total

    def _corners(self, perturbation: Perturbation) -> Iterator[_Corners]:
        """Yield the corners of strips of cells where they land."""
        for weight, cells, trace in self._light.colours(perturbation):
            for strip in cells.slices(CORNERS_AT_ONCE):
                yield _landed(self._light, weight, strip, trace)

    def _mapped(self, corners: _Corners) -> MappedCells:
        emitted = corners.cells.emitted
        return MappedCells(self._light.backend, self._light.screen, emitted, corner_flux(emitted))

    def _pictured(self, corners: _Corners, rate: Floats, bend: Floats, sound: NDArray[np.bool_]) -> Floats:
        """Return the irradiance of corners that have moved."""
        backend, mapped = self._light.backend, self._mapped(corners)
        x, y, flux = (backend.array(row) for row in corners.jet + rate + bend / 2)
        with backend.dr.suspend_grad():
            image = mapped(x, y, flux, backend.array(sound) > 0).numpy()
        return np.asarray(image.reshape(self._light.screen.shape, order="F"))

    def _pushed(self, corners: _Corners, rate: Floats, _: Floats, sound: NDArray[np.bool_]) -> Floats:
        """Return the derivative of the irradiance of corners that move at a rate."""
        backend, mapped = self._light.backend, self._mapped(corners)
        dr = backend.dr
        with dr.resume_grad():
            x, y, flux = (backend.array(row) for row in corners.jet)
            leaves = x, y, flux
            dr.enable_grad(*leaves)
            image = mapped(x, y, flux, backend.array(sound) > 0)
            for leaf, row in zip(leaves, rate):
                dr.set_grad(leaf, backend.array(row))
            dr.enqueue(dr.ADMode.Forward, *leaves)
            dr.traverse(dr.ADMode.Forward)
            slope = dr.grad(image) + dr.zeros(backend.Float, dr.width(image))
        return np.asarray(slope.numpy().reshape(self._light.screen.shape, order="F"))


@dataclass(frozen=True, eq=False)
class _Corners:
    """Corners of cells on the target.  jet : x, y and flux, (3, n).  sound : which of them arrive, (n,)."""

    weight: float
    cells: SourceCells
    jet: Floats
    sound: NDArray[np.bool_]


def _landed(light: PerturbedLight, weight: float, cells: SourceCells, trace: Trace) -> _Corners:
    rays, dr = cells.rays(), light.backend.dr
    _, landing = trace(rays)
    every = dr.ones(dr.mask_t(light.backend.Float), rays.flux.size)
    sound = (every & landing.definite & landing.met & landing.hit).numpy()
    jet = np.array([a.numpy() + np.zeros(rays.flux.size) for a in (landing.x, landing.y, landing.flux)])
    return _Corners(weight, cells, np.where(sound, jet, 0.0), sound)


def _cut(sound: NDArray[np.bool_], emitted: Floats) -> bool:
    """Whether some corner of a cell that shines does not arrive while others do."""
    nx, ny = emitted.shape
    seen = sound.astype(np.int8).reshape(nx + 1, ny + 1)
    corners = seen[1:, 1:] + seen[1:, :-1] + seen[:-1, 1:] + seen[:-1, :-1]
    return bool(((corners > 0) & (corners < 4) & (emitted > 0)).any())
