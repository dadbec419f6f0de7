"""The light of a diverging beam, or behind rough surfaces, on box pixels: means over parallel beams.

Cells measure light without noise that is parallel, or comes from a point.  Here that is done for many
directions of the beam, and for many errors of the slopes of front and rear, each the same everywhere: in the
mean over them every point of the lens meets every direction and every error, as in the mean over rays.  The
mean converges as fast as the light is smooth over the spread of one source point, so that few samples do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from math import ceil, cos, log1p, pi, sin, sqrt
from operator import add
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from optics.analysis.light_estimate import LightEstimate
from optics.analysis.light_of_cells import cell_irradiance
from optics.tracing import SlopeErrors

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from optics.runtime import Backend
    from optics.sources import SourceCells
    from optics.system import OpticalSystem
    from optics.target import Screen
    from optics.tracing import SequentialFates
    from thbcad.lens import Lens

Floats = NDArray[np.float64]

REPLICATES = 4  # independent sets of samples: their differences tell the error
# samples of a set: of one quantity that spreads a sunflower, which is turned by quarters so that symmetric
# light stays symmetric; of several Sobol points in all their dimensions
SUNFLOWER, SEVERAL = 8, 32
QUARTERS = pi / 2 * np.arange(4)
CELLS_PER_PIXEL = 2  # in each direction: what single beams leave is averaged over all of them
LEAST_CELLS = 128
GOLDEN = pi * (3 - sqrt(5))  # angle between neighbours of a sunflower


def beam_irradiance(
    system: OpticalSystem, lens: Lens, screen: Screen, backend: Backend
) -> tuple[LightEstimate, SequentialFates]:
    """Return (irradiance through front and rear, W/mm^2, flux by fate).  backend : of double precision."""
    counts = [max(LEAST_CELLS, ceil(CELLS_PER_PIXEL * n)) for n in screen.pixels]
    fates: list[SequentialFates] = []

    def replicates() -> Iterator[tuple[Floats, float, float]]:
        for samples in _sets(system):
            parts = [
                cell_irradiance(system, lens, screen, _cells(system, counts, sample), backend, sample.errors)
                for sample in samples
            ]
            by_fate = reduce(add, (part for _, part in parts)) / len(parts)
            fates.append(by_fate)
            image = reduce(add, (image for image, _ in parts)) / len(parts)
            yield image, by_fate.on_target, by_fate.off_target

    light = LightEstimate.of_replicates(replicates())
    return light, reduce(add, fates) / REPLICATES


@dataclass(frozen=True, eq=False)
class _Sample:
    """A direction of the beam, None of light that does not diverge, and errors of the slopes."""

    direction: Floats | None
    errors: SlopeErrors


def _cells(system: OpticalSystem, counts: Sequence[int], sample: _Sample) -> SourceCells:
    if sample.direction is None:
        return system.source.cells(counts)
    return system.source.beam(counts, sample.direction)


def _sets(system: OpticalSystem) -> Iterator[list[_Sample]]:
    """Yield the samples of every replicate."""
    rng = np.random.default_rng(system.problem.run.seed)
    spread = [system.source.diverging, *map(bool, system.slope_rms)]
    for _ in range(REPLICATES):
        yield [
            _sample(system, dict(zip(np.flatnonzero(spread), row))) for row in _disk_points(sum(spread), rng)
        ]


def _disk_points(disks: int, rng: np.random.Generator) -> Floats:
    """Return points on as many disks at once, (n, disks, 2): the share of the area within, and the angle."""
    if disks > 1:
        points = qmc.Sobol(2 * disks, rng=rng).random(SEVERAL).reshape(SEVERAL, disks, 2)
        return np.asarray(points * (1, 2 * pi))
    k = np.arange(SUNFLOWER)
    angle = rng.uniform(0, 2 * pi) + GOLDEN * k + QUARTERS[:, None]
    within = np.broadcast_to((k + 0.5) / SUNFLOWER, angle.shape)
    return np.stack([within.ravel(), angle.ravel()], axis=1)[:, None, :]


def _sample(system: OpticalSystem, points: dict[int, Floats]) -> _Sample:
    """Return the sample of points on the disks of beam (0) and of the slopes of front (1) and rear (2)."""
    errors = [
        rms * sqrt(-2 * log1p(-points[k][0])) * np.array([[cos(points[k][1])], [sin(points[k][1])]])
        if k in points
        else None
        for k, rms in enumerate(system.slope_rms, 1)
    ]
    direction = system.source.spread.direction(*points[0]) if 0 in points else None
    return _Sample(direction, SlopeErrors(*errors))
