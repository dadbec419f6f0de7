"""The light of a diverging beam, or behind rough surfaces, on box pixels: means over parallel beams.

Cells measure light without noise that is parallel, or comes from a point.  Here that is done for many
directions of the beam, and for many errors of the slopes of front and rear, each the same everywhere: in the
mean over them every point of the lens meets every direction and every error, as in the mean over rays.

Beams show the sharp picture at shifted places.  So much as a shift explains is known for all directions: with
the sharp light S, the blur k, its samples k_N and the sharp light S_N of as few cells as a beam has,

    E = E_N + k * S - k_N * S_N,

whose error is what no shift explains (a control variate).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from math import ceil, cos, log1p, pi, sin, sqrt
from operator import add

import numpy as np
from scipy.ndimage import convolve1d

from optics.base.runtime import Backend
from optics.light.analysis.border_triangles import Borders
from optics.light.analysis.light_estimate import REPLICATES, Light, LightEstimate
from optics.light.analysis.light_of_cells import cell_irradiance, images_of_cells
from optics.light.blur import Blur, LandingShifts, blur_of
from optics.light.tracing import SequentialFates
from optics.scene.paths import LightPath, SlopeErrors
from optics.scene.receivers import Screen
from optics.scene.system import System
from thbcad.checks import Floats

# samples of a replicate: of one quantity that spreads a sunflower, which is turned by quarters so that
# symmetric light stays symmetric; of several Sobol points in all their dimensions
SUNFLOWER, SEVERAL = 2, 16
QUARTERS = pi / 2 * np.arange(4)
# in each direction: what single beams leave is averaged over all of them, the sharp light stands alone
CELLS_PER_PIXEL, SHARP_CELLS_PER_PIXEL = 2, 5
FINER = 5  # pixels of the sharp light in one of the screen, in each direction
# a filter without the highest frequency of these finer pixels, which leaves nearly all of the screen's
STILL = np.array([1, -6, 15, 44, 15, -6, 1]) / 64
LEAST_CELLS = 128
BORDERS = Borders(cells=1000, bisections=5)  # of the cells of a beam: more of both change 1e-4 of the light
AXIS = np.array([0.0, 0.0, 1.0])
GOLDEN = pi * (3 - sqrt(5))  # angle between neighbours of a sunflower


def beam_irradiance(
    system: System, path: LightPath, screen: Screen, backend: Backend, boxes: Screen | None = None
) -> tuple[LightEstimate, SequentialFates]:
    """Return (irradiance along a path, W/mm^2, flux by fate).

    Noise may leave dark pixels a little less than no light.

    system : whose beam diverges, or whose surfaces are rough.  backend : of double precision.
    boxes : a second screen, on which the same light is measured.

    Raises UserError : see `Blur.widened`.
    """
    counts = _beam_cells(screen)
    rest = _Rest.of(system, path, screen, backend)
    screens = [screen] if boxes is None else [screen, boxes]
    fates: list[SequentialFates] = []
    rng = np.random.default_rng(system.problem.run.seed)
    spread = np.flatnonzero([system.source.diverging, *map(bool, system.slope_rms)])

    def replicates() -> Iterator[Light]:
        for _ in range(REPLICATES):
            samples = [_sample(system, dict(zip(spread, row))) for row in _disk_points(len(spread), rng)]
            parts = [
                images_of_cells(
                    path.with_slope_errors(s.errors),
                    screens,
                    system.source.cells(counts, direction=s.direction),
                    backend,
                    BORDERS,
                )
                for s in samples
            ]
            by_fate = reduce(add, (part for _, part in parts)) / len(parts)
            fates.append(by_fate)
            means = [reduce(add, images) / len(parts) for images in zip(*(images for images, _ in parts))]
            images = [mean + rest for mean, rest in zip(means, rest.on(screens, samples))]
            on_target = float(images[0].sum()) * screen.pixel_area
            yield Light.of(images, on_target, by_fate.transmitted - on_target)

    light = LightEstimate.of_replicates(replicates())
    arriving = reduce(add, fates) / REPLICATES
    on = min(light.on_target, arriving.transmitted)  # noise takes no more than there is
    return light, arriving.landing(on, arriving.transmitted - on)


@dataclass(frozen=True, eq=False)
class _Sample:
    """A direction of the beam, None of light that does not diverge, and errors of the slopes."""

    direction: Floats | None
    errors: SlopeErrors

    def shift(self, shifts: LandingShifts) -> Floats:
        """Return by how much the light of this sample lands beside the sharp light, (2,)."""
        moved = np.zeros(2) if self.direction is None else shifts.beam @ self.direction[:2]
        for error, matrix in zip(self.errors, (shifts.front, shifts.rear)):
            if error is not None:
                moved = moved + matrix @ error[:, 0]
        return moved


@dataclass(frozen=True, eq=False)
class _Rest:
    """What samples leave out of a blur, and what their cells are off by.

    blurred : the sharp light of many cells, blurred.  coarse : that of as many cells as a beam has.
    Both are on a screen that is wider by the blur's reach, with FINER times finer pixels: shifts by parts of
    a pixel move what lies within it.
    """

    blurred: Floats
    coarse: Floats
    blur: Blur
    screen: Screen

    @classmethod
    def of(cls, system: System, path: LightPath, screen: Screen, backend: Backend) -> _Rest:
        blur = blur_of(system, path, backend)
        wide = blur.widened(screen).finer(FINER)
        many = [max(LEAST_CELLS, SHARP_CELLS_PER_PIXEL * n) for n in screen.pixels]
        fine, _ = cell_irradiance(path, wide, system.sharp.source.cells(many), backend)
        middle = AXIS if system.source.diverging else None
        beam = system.source.cells(_beam_cells(screen), direction=middle)
        coarse, _ = cell_irradiance(path, wide, beam, backend, BORDERS)
        return cls(blur.convolution(wide, fine.shape)(fine), coarse, blur, screen)

    def on(self, screens: Sequence[Screen], samples: Sequence[_Sample]) -> list[Floats]:
        """Return k * S - k_N * S_N on screens."""
        shifts = np.array([sample.shift(self.blur.shifts) for sample in samples])
        rest = self.blurred - self.blur.sampled(self.coarse, self.screen.finer(FINER), shifts)
        for axis in (0, 1):  # shifts of a sharp edge ring at the pixels' own frequency
            rest = convolve1d(rest, STILL, axis)
        rows, columns = rest.shape
        (width, height), (hx, hy) = self.screen.pitch, (columns / FINER / 2, rows / FINER / 2)
        wide = replace(self.screen, half_width=(width * hx, height * hy), pixels=(columns, rows))
        return [screen.means_of(rest, wide) for screen in screens]


def _beam_cells(screen: Screen) -> list[int]:
    """Return the cells of a beam in x and y."""
    return [max(LEAST_CELLS, ceil(CELLS_PER_PIXEL * n)) for n in screen.pixels]


def _disk_points(disks: int, rng: np.random.Generator) -> Floats:
    """Return points on as many disks at once, (n, disks, 2): the share of the area within, and the angle."""
    if disks > 1:
        from scipy.stats import qmc  # a third of a second, which sharp light does not need

        points = qmc.Sobol(2 * disks, rng=rng).random(SEVERAL).reshape(SEVERAL, disks, 2)
        return np.asarray(points * (1, 2 * pi))
    k = np.arange(SUNFLOWER)
    angle = rng.uniform(0, 2 * pi) + GOLDEN * k + QUARTERS[:, None]
    # anywhere in its ring: what rings of the same radii leave would be no difference of sets
    within = np.broadcast_to((k + rng.uniform(size=SUNFLOWER)) / SUNFLOWER, angle.shape)
    return np.stack([within.ravel(), angle.ravel()], axis=1)[:, None, :]


def _sample(system: System, points: dict[int, Floats]) -> _Sample:
    """Return the sample of points on the disks of beam (0) and of the slopes of front (1) and rear (2)."""
    errors = [
        rms * sqrt(-2 * log1p(-points[k][0])) * np.array([[cos(points[k][1])], [sin(points[k][1])]])
        if k in points
        else None
        for k, rms in enumerate(system.slope_rms, 1)
    ]
    direction = system.source.spread.direction(*points[0]) if 0 in points else None
    return _Sample(direction, errors)
