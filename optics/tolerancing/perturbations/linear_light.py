"""What a perturbation does to the light, from the derivatives of the landing points.

Where light lands, and how much of it, is smooth in the amount a of a perturbation,

    L(a) = L + a L' + a^2 L'' / 2 + O(a^3),

with L' and L'' by symmetric differences of exact traces, along corners of cells that stay on the lens
(`LensPath`).  Mapped cells carry them to exact irradiance.

Irradiance itself is not smooth in a: bright lines that are finer than a pixel pass the borders of pixels.
Its derivative, which mapped cells have too,

    dE = J p = T(L; L'),

is right for amounts that move light by hundredths of a pixel, where the light has such lines.

Cells that a rim cuts, and rays, have neither.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from optics.light.analysis import cut_cells
from optics.light.measuring import MappedCells
from optics.scene.sources import RayGrid, Rays, SourceCells, corner_flux
from optics.tolerancing.perturbations.lens_path import STEP, LensPath, LensPaths
from optics.tolerancing.perturbations.perturbation import NOMINAL, Perturbation
from optics.tolerancing.perturbations.traced_light import CORNERS_AT_ONCE, PerturbedLight, Trace
from thbcad.checks import Bools, Floats


class LinearLight:
    """What perturbations do to the light of one lens, by derivatives of the landing points.

    estimate : of the design's light, see `PerturbedLight.estimate`.  irradiance : (rows, columns), of it.
    """

    def __init__(self, light: PerturbedLight) -> None:
        self._light = light
        self.estimate, _ = light.estimate(NOMINAL)
        self.irradiance = self.estimate.irradiance / light.screen.projection()
        self._here: list[_Corners] = []
        if light.by_cells:
            self._here, self._paths = list(self._corners(NOMINAL)), LensPaths(light)

    def derivative(self, perturbation: Perturbation) -> Floats | None:
        """Return dE = J p, (rows, columns); None of rays, and where a rim cuts cells."""
        if not self._light.by_cells:
            return None
        steps = (self._corners(a * perturbation) for a in (STEP, -STEP))
        return self._summed(
            self._pushed(here, (ahead.jet - behind.jet) / (2 * STEP), _all_sound(here, ahead, behind))
            for here, ahead, behind in zip(self._here, *steps)
        )

    def moved(self, perturbation: Perturbation) -> Floats | None:
        """Return the light of the landing points L - L' + L''/2 and L + L' + L''/2, (2, rows, columns).

        None as of `derivative`.
        """
        if not self._light.by_cells:
            return None
        path = self._paths(perturbation)
        steps = (self._corners(a * perturbation, path, a) for a in (STEP, -STEP))
        return self._summed(self._moved(*corners) for corners in zip(self._here, *steps))

    def traced(self, perturbation: Perturbation) -> Floats | None:
        """Return the exact light of the cells that `moved` predicts, (rows, columns); None as of it.

        The light of cells that slide differs from it by what the size of cells leaves: with usual ones by a
        tenth of the change where light moves by a tenth of a pixel.
        """
        if not self._light.by_cells:
            return None
        there = self._corners(perturbation, self._paths(perturbation), 1.0)
        return self._summed(
            self._pictured(c, c.jet, _all_sound(h, c), c.emitted(1.0)) for h, c in zip(self._here, there)
        )

    def _moved(self, here: _Corners, ahead: _Corners, behind: _Corners) -> Floats | None:
        """Return what `moved` does, of a strip of cells."""
        sound = _all_sound(here, ahead, behind)
        rate = (ahead.jet - behind.jet) / (2 * STEP)
        bend = (ahead.jet + behind.jet - 2 * here.jet) / STEP**2
        images = []
        for a in (-1.0, 1.0):
            image = self._pictured(ahead, here.jet + a * rate + bend / 2, sound, ahead.emitted(a))
            if image is None:
                return None
            images.append(image)
        return np.stack(images)

    def _summed(self, images: Iterable[Floats | None]) -> Floats | None:
        """Return the sum of images on the target; None where one is None."""
        total = np.zeros(())
        for image in images:
            if image is None:
                return None
            total = total + image
        return total / self._light.screen.projection()

    def _corners(
        self, perturbation: Perturbation, path: LensPath | None = None, amount: float = 0.0
    ) -> Iterator[_Corners]:
        """Yield the corners of strips of cells where they land, as far along a path as an amount says."""
        for weight, parts, trace in self._light.colours(perturbation):
            first = 0
            for strip in self._light.cells.slices(CORNERS_AT_ONCE):
                part = path.rows(first, len(strip.s)) if path else None
                if part is None:
                    rays = parts.cells(strip).rays()
                else:
                    s, t = (v.ravel() for v in part.corners(strip, amount))
                    rays = parts.rays(strip.at(s, t, corner_flux(strip.emitted).ravel()))
                yield _Corners(weight, strip, part, rays.flux, *self._arriving(trace, rays))
                first += len(strip.s) - 1

    def _arriving(self, trace: Trace, rays: RayGrid | Rays) -> tuple[Floats, Bools]:
        """Return x, y and flux of rays where they land, (3, n), and which of them arrive, (n,)."""
        backend, n = self._light.backend, rays.flux.size
        _, landing = trace(rays)
        every = backend.dr.ones(backend.dr.mask_t(backend.Float), n)
        sound = (every & landing.arrives).numpy()
        jet = np.array([a.numpy() + np.zeros(n) for a in (landing.x, landing.y, landing.flux)])
        return np.where(sound, jet, 0.0), sound

    def _pictured(self, corners: _Corners, jet: Floats, sound: Bools, emitted: Floats) -> Floats | None:
        """Return the light of corners that land as a jet says; None where a rim cuts their cells."""
        if cut_cells(sound, emitted).any():
            return None
        backend, mapped = self._light.backend, self._mapped(corners, emitted)
        x, y, flux = (backend.array(row) for row in jet)
        with backend.dr.suspend_grad():
            image = mapped(x, y, flux, backend.array(sound) > 0).numpy()
        return np.asarray(corners.weight * image.reshape(self._light.screen.shape, order="F"))

    def _pushed(self, corners: _Corners, rate: Floats, sound: Bools) -> Floats | None:
        """Return the derivative of the light of corners that move at a rate; None as of `_pictured`."""
        emitted = corners.cells.emitted
        if cut_cells(sound, emitted).any():
            return None
        backend, mapped = self._light.backend, self._mapped(corners, emitted)
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
        return np.asarray(corners.weight * slope.numpy().reshape(self._light.screen.shape, order="F"))

    def _mapped(self, corners: _Corners, emitted: Floats) -> MappedCells:
        backend, screen = self._light.backend, self._light.screen
        return MappedCells(backend, screen, emitted, corners.flux, corners.cells.turned)


@dataclass(frozen=True, eq=False)
class _Corners:
    """Corners of cells on the target.

    weight : of their wavelength.  cells, path : in the source.  flux : that the corners stand for, W.
    jet : x, y and flux that arrives, (3, n).  sound : which of them arrive, (n,).
    """

    weight: float
    cells: SourceCells
    path: LensPath | None
    flux: Floats
    jet: Floats
    sound: Bools

    def emitted(self, amount: float) -> Floats:
        """Return what the cells emit as far along the path as an amount says, W."""
        return self.path.emitted(self.cells, amount) if self.path else self.cells.emitted


def _all_sound(*corners: _Corners) -> Bools:
    return np.all([c.sound for c in corners], axis=0)
