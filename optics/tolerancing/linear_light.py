"""How light changes with a perturbation, to first and second order in its amount.

Light of cells: the landing points and the flux of the corners change by L' and L'' along a perturbation,
which symmetric differences of exact traces give.  The irradiance of mapped cells carries them on exactly, as
its own derivative T along directions:

    dE = T(L; L'),      d2E = [T(L + L' + L''/2; L' + L'') - T(L - L' + L''/2; L' - L'')] / 2.

Cells that a rim cuts, and rays, have no such derivative; there both are differences of exact light.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.sources import corner_flux
from optics.target import MappedCells
from optics.tolerancing.perturbation import NOMINAL, Floats, Perturbation

if TYPE_CHECKING:
    from collections.abc import Iterator

    from optics.sources import SourceCells
    from optics.tolerancing.traced_light import PerturbedLight, Trace

CORNERS_AT_ONCE = 1 << 19  # more only take more memory
HALF = 0.5  # of the amount, at which light is compared where cells have no derivative


@dataclass(frozen=True, eq=False)
class LightChange:
    """The change of light E(a p) = E(0) + a first + a^2 second, in the units of the light.

    first, second : (rows, columns), for the amount a = 1.
    """

    first: Floats
    second: Floats

    def at(self, amount: float) -> Floats:
        """Return the change for an amount."""
        return amount * self.first + amount**2 * self.second


class LinearLight:
    """Changes of the light of one lens.

    irradiance : (rows, columns), of the design.
    """

    def __init__(self, light: PerturbedLight) -> None:
        self._light = light
        self.irradiance, self.fates = light(NOMINAL)
        self._here = list(self._corners(NOMINAL)) if light.by_cells else []

    def along(self, perturbation: Perturbation) -> LightChange:
        """Return the LightChange along a perturbation, whose amount is 1 there.

        It should move light by less than a pixel.
        """
        return self.derivative(perturbation) or self._by_differences(perturbation)

    def derivative(self, perturbation: Perturbation) -> LightChange | None:
        """Return the change by the derivative of mapped cells; None of rays, and where a rim cuts cells."""
        return self._of_cells(perturbation) if self._light.by_cells else None

    def _by_differences(self, perturbation: Perturbation) -> LightChange:
        ahead, behind = (self._light(sign * HALF * perturbation)[0] for sign in (1, -1))
        first = (ahead - behind) / (2 * HALF)
        return LightChange(first, (ahead + behind - 2 * self.irradiance) / (2 * HALF**2))

    def _of_cells(self, perturbation: Perturbation) -> LightChange | None:
        light = self._light
        first, second = np.zeros(light.screen.shape), np.zeros(light.screen.shape)
        corners = zip(self._here, self._corners(perturbation), self._corners(-perturbation))
        for here, ahead, behind in corners:
            if here is None or ahead is None or behind is None:
                return None
            sound = here.sound & ahead.sound & behind.sound
            if _cut(sound, here.cells.emitted):
                return None
            rate, bend = (ahead.jet - behind.jet) / 2, ahead.jet + behind.jet - 2 * here.jet
            scale = here.weight / light.screen.projection()
            first += scale * self._pushed(here, here.jet, rate, sound)
            turn = self._pushed(here, ahead.jet, rate + bend, sound)
            second += scale / 4 * (turn - self._pushed(here, behind.jet, rate - bend, sound))
        return LightChange(first, second)

    def _corners(self, perturbation: Perturbation) -> Iterator[_Corners | None]:
        """Yield the corners of strips of cells where they land."""
        for weight, cells, trace in self._light.colours(perturbation):
            for strip in cells.slices(CORNERS_AT_ONCE):
                yield _landed(self._light, weight, strip, trace)

    def _pushed(self, corners: _Corners, jet: Floats, rate: Floats, sound: NDArray[np.bool_]) -> Floats:
        """Return the derivative of the irradiance for corners at `jet` that change at a rate."""
        light = self._light
        backend, dr = light.backend, light.backend.dr
        emitted = corners.cells.emitted
        mapped = MappedCells(backend, light.screen, emitted, corner_flux(emitted))
        with dr.resume_grad():
            x, y, flux = (backend.array(row) for row in jet)
            leaves = x, y, flux
            dr.enable_grad(*leaves)
            image = mapped(x, y, flux, backend.array(sound) > 0)
            for leaf, row in zip(leaves, rate):
                dr.set_grad(leaf, backend.array(row))
            dr.enqueue(dr.ADMode.Forward, *leaves)
            dr.traverse(dr.ADMode.Forward)
            slope = dr.grad(image) + dr.zeros(backend.Float, dr.width(image))
        return slope.numpy().reshape(light.screen.shape, order="F")


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
