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

REPLICATES = 4  # sets of samples: their differences tell the error
ONE, SEVERAL = 4, 2  # samples of a set for one quantity that spreads, and for several, before they are turned
# turns of a sample by 90 degrees, a row each: means over them vanish, variances in x and y are equal, and
# quantities have no covariance
QUARTERS = [(a,) for a in range(4)]
PAIRED_QUARTERS = [(a, b, a + b) for a in range(4) for b in range(4)]
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
    """Yield the samples of every replicate.

    Every quantity that spreads has one quantile of its own in each of as many equal parts as there are
    samples before they are turned.
    """
    rng = np.random.default_rng(system.problem.run.seed)
    spread = [system.source.diverging, *map(bool, system.slope_rms)]
    bases, turns = (ONE, QUARTERS) if sum(spread) == 1 else (SEVERAL, PAIRED_QUARTERS)
    count = REPLICATES * bases
    quantiles = [(rng.permutation(count) + 0.5) / count for _ in spread]
    angles = [rng.uniform(0, 2 * pi) + GOLDEN * rng.permutation(count) for _ in spread]
    for k in range(REPLICATES):
        yield [
            _sample(system, spread, [q[i] for q in quantiles], [a[i] for a in angles], turn)
            for i in range(k * bases, (k + 1) * bases)
            for turn in turns
        ]


def _sample(
    system: OpticalSystem,
    spread: Sequence[bool],
    quantiles: Sequence[float],
    angles: Sequence[float],
    turn: Sequence[int],
) -> _Sample:
    """Return a sample from the quantiles and angles of beam, front and rear, turned by quarters."""
    quarters = iter(turn)
    angles = [a + pi / 2 * next(quarters) if s else a for s, a in zip(spread, angles)]
    direction = system.source.spread.direction(quantiles[0], angles[0]) if spread[0] else None
    errors = [
        rms * sqrt(-2 * log1p(-u)) * np.array([[cos(a)], [sin(a)]]) if rms else None
        for rms, u, a in zip(system.slope_rms, quantiles[1:], angles[1:])
    ]
    return _Sample(direction, SlopeErrors(*errors))
