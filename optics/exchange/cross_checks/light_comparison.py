"""The light of an independent program through a STEP file, beside ours through the lens in memory.

Random rays are traced by both.  The difference of two traces of the same rays has no noise but that of rays
at the borders of pixels.  Beside the light of exact cells (of other rays, for extended sources) stands that
of the random rays by itself: with d the difference on a pixel and v its variance, all on merged pixels,

    z = sum(d^2 - v) / sqrt(2 sum(v^2)),

whose mean is 0 and whose variance is 1 where both lights are the same.  v is the sum of the squared flux of
the rays on the pixel; for a count, v = n, the variance of (n - mu)^2 - n is 2 mu^2.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import floor, isqrt, sqrt
from time import perf_counter
from typing import Any

import numpy as np

from optics.base.runtime import Backend
from optics.exchange.cross_checks.file_tracers import FileTracer
from optics.exchange.cross_checks.light_sums import Distances, binned, distances, on_target
from optics.exchange.cross_checks.meshed_file import COARSER
from optics.exchange.cross_checks.random_rays import random_rays
from optics.exchange.verification import exact_landing
from optics.light.analysis import cell_irradiance
from optics.scene.paths import LightPath
from optics.scene.receivers import Screen
from optics.scene.sources import Rays
from optics.scene.system import System
from thbcad.checks import Floats

RAYS_PER_PIXEL = 400  # noise of 5 %
RAYS_AT_ONCE = 1 << 20
CELLS_PER_PIXEL, LEAST_CELLS = 16, 769  # in each direction: errors of 2e-4 on pearl's own pixels
LEAST_SOBOL = 1 << 20  # rays of each of the two sets that stand for cells of extended sources


@dataclass(frozen=True, eq=False)
class LightComparison:
    """The irradiance by an independent program and by ours on merged pixels, (rows, columns) W/mm^2, W per
    square degree in the far field.

    theirs, same_rays : of the same rays, by the program through the file and by ours.  coarser : by the
        program through a mesh of every second node, None where it meets the faces exactly.
    ours : of cells, or of other rays; ours_error : as many standard deviations of it, None for cells.
    variance : of theirs.  to_ours, to_coarser : distances of the landing points of the same rays.
    rays, emitted : number, and their flux in W.  seconds : of the program.
    """

    name: str
    screen: Screen
    theirs: Floats
    same_rays: Floats
    coarser: Floats | None
    ours: Floats
    ours_error: Floats | None
    variance: Floats
    to_ours: Distances
    to_coarser: Distances | None
    resolution: float | None
    rays: int
    emitted: float
    seconds: float

    @property
    def metrics(self) -> dict[str, Any]:
        """All numbers by name."""
        rows, columns = self.screen.shape
        return {
            "tracer": self.name,
            "rays": self.rays,
            "seconds": self.seconds,
            "pixels": [columns, rows],
            "rays_per_pixel": self.rays_per_pixel,
            "same_rays": {
                "landing_rms": self.to_ours.rms,
                "landing_greatest": self.to_ours.greatest,
                "unit": self.screen.unit,
                "other_fate": self.to_ours.mismatched / self.emitted,
                "difference": self.difference_of_same_rays,
            },
            "mesh_error": None
            if self.to_coarser is None
            else {"landing_rms": self.mesh_landing, "difference": self.mesh_difference},
            "own_rays": {
                "beside": "other rays" if self.ours_error is not None else "cells",
                "difference": self.difference,
                "noise": self.noise,
                "z": self.z,
            },
        }

    @property
    def rays_per_pixel(self) -> float:
        """Mean number of rays, from flux and variance."""
        squares = self.variance.sum()
        return float(self.theirs.sum() ** 2 / (squares * self.theirs.size)) if squares else 0.0

    @property
    def difference_of_same_rays(self) -> float:
        """Relative L2 difference of theirs from ours for the same rays: without noise."""
        return _relative(self.theirs, self.same_rays)

    @property
    def mesh_landing(self) -> float:
        """Error of landing points by the mesh, root mean square; from every second node, 0 without mesh."""
        return 0.0 if self.to_coarser is None else self.to_coarser.rms / COARSER

    @property
    def mesh_difference(self) -> float:
        """Relative L2 error of the irradiance by the mesh.

        Rays that change their pixel are in proportion to the error of landing points, and their noise is as
        the root of their number: sqrt(COARSER) is the least factor from it to what every second node changes.
        """
        return 0.0 if self.coarser is None else _relative(self.theirs, self.coarser) / sqrt(COARSER)

    @property
    def border_noise(self) -> float:
        """Relative L2 difference that four rays make which land beside the border of another pixel."""
        total = self.theirs.sum()
        each = self.variance.sum() / total if total else 0.0
        norm = float(np.linalg.norm(self.same_rays))
        return sqrt(8) * float(each) / norm if norm else 0.0

    @property
    def difference(self) -> float:
        """Relative L2 difference of theirs from ours by cells or other rays."""
        return _relative(self.theirs, self.ours)

    @property
    def noise(self) -> float:
        """The relative L2 difference to expect of equal lights."""
        norm = float(np.linalg.norm(self.ours))
        return sqrt(self._all_variance.sum()) / norm if norm else 0.0

    @property
    def z(self) -> float:
        """Standard deviations of the squared difference from that of equal lights."""
        variance = self._all_variance
        excess = np.square(self.theirs - self.ours).sum() - variance.sum()
        spread = sqrt(2 * np.square(variance).sum())
        return float(excess / spread) if spread else float("inf")

    @property
    def _all_variance(self) -> Floats:
        if self.ours_error is None:
            return self.variance
        return self.variance + np.square(self.ours_error).mean()


def _relative(image: Floats, truth: Floats) -> float:
    norm = np.linalg.norm(truth)
    return float(np.linalg.norm(image - truth) / norm) if norm else float("inf")


@dataclass(eq=False)
class _Sums:
    """What the parts of the rays add up to; images are (2, rows, columns), flux and squared flux."""

    theirs: Floats
    same: Floats
    coarser: Floats
    to_ours: Distances
    to_coarser: Distances
    seconds: float = 0.0


def compare_light(system: System, tracer: FileTracer, count: int, backend: Backend) -> LightComparison:
    """Return the LightComparison of `count` random rays of the system's source.

    backend : of double precision.
    """
    # of these a STEP file tells nothing
    path = system.path.without_absorption().without_stops().without_coats()
    parts = random_rays(system.source, tracer.start, count, system.problem.run.seed + 1, RAYS_AT_ONCE)
    screen, sums = _traced(system, path, tracer, parts, count, backend)
    ours, error = _without_them(system, path, screen, count, backend)
    area = screen.pixel_area
    exact = tracer.coarser is None
    return LightComparison(
        name=tracer.name,
        screen=screen,
        theirs=sums.theirs[0] / area,
        same_rays=sums.same[0] / area,
        coarser=None if exact else sums.coarser[0] / area,
        ours=ours,
        ours_error=error,
        variance=sums.theirs[1] / area**2,
        to_ours=sums.to_ours,
        to_coarser=None if exact else sums.to_coarser,
        resolution=tracer.resolution,
        rays=count,
        emitted=system.problem.flux,
        seconds=sums.seconds,
    )


def _traced(
    system: System,
    path: LightPath,
    tracer: FileTracer,
    parts: Iterator[Rays],
    count: int,
    backend: Backend,
) -> tuple[Screen, _Sums]:
    """Return the merged pixels and the sums over all rays."""
    screen: Screen | None = None
    sums = _Sums(np.zeros(0), np.zeros(0), np.zeros(0), Distances(), Distances())
    for rays in parts:
        ours = exact_landing(path, rays, backend)
        if screen is None:
            screen = merged(system, on_target(ours, system.target.screen()) / len(rays.flux) * count)
            sums.theirs = sums.same = sums.coarser = np.zeros((2, *screen.shape))
        start = perf_counter()
        theirs = tracer.trace(rays)
        sums.seconds += perf_counter() - start
        sums.theirs = sums.theirs + binned(theirs, screen)
        sums.same = sums.same + binned(ours, screen)
        sums.to_ours += distances(theirs, ours, rays.flux, screen)
        if tracer.coarser is not None:
            coarser = tracer.coarser(rays)
            sums.coarser = sums.coarser + binned(coarser, screen)
            sums.to_coarser += distances(coarser, theirs, rays.flux, screen)
    assert screen is not None  # there is at least one ray
    return screen, sums


def merged(system: System, landing: float) -> Screen:
    """Return the target with pixels on each of which about RAYS_PER_PIXEL of `landing` rays fall, or with its
    own ones where these are larger."""
    screen = system.target.screen()
    columns, rows = screen.pixels
    factor = min(1.0, sqrt(landing / (RAYS_PER_PIXEL * columns * rows)))
    return replace(screen, pixels=(max(1, floor(factor * columns)), max(1, floor(factor * rows))))


def _without_them(
    system: System, path: LightPath, screen: Screen, count: int, backend: Backend
) -> tuple[Floats, Floats | None]:
    """Return (our irradiance without the random rays, its error): of cells, or of two sets of Sobol points.

    The error of the latter is half their difference; that of cells is below all noise.
    """
    if not system.source.extended:
        cells = [max(LEAST_CELLS, CELLS_PER_PIXEL * n) for n in screen.pixels]
        image, _ = cell_irradiance(path, screen, system.source.cells(cells), backend)
        return image, None
    side = isqrt(max(count, LEAST_SOBOL))
    fresh = np.random.default_rng(system.problem.run.seed)
    images = []
    for _ in range(2):
        parts = system.source.parts((side, side), fresh, RAYS_AT_ONCE)
        sums = sum(binned(exact_landing(path, part, backend), screen)[0] for part in parts)
        images.append(sums / screen.pixel_area)
    return (images[0] + images[1]) / 2, (images[0] - images[1]) / 2
