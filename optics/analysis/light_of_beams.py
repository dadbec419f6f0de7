"""The light of a diverging beam on box pixels: parallel beams in many directions, each by its cells.

Cells measure a parallel beam without noise.  The mean over directions of equal flux converges as fast as the
light is smooth over the spread of one source point, so that few directions do.
"""

from __future__ import annotations

from functools import reduce
from math import ceil, pi
from operator import add
from typing import TYPE_CHECKING

import numpy as np

from optics.analysis.light_estimate import LightEstimate
from optics.analysis.light_of_cells import cell_irradiance

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from optics.runtime import Backend
    from optics.system import OpticalSystem
    from optics.target import Screen
    from optics.tracing import SequentialFates
    from thbcad.lens import Lens

REPLICATES = 4  # sets of directions, each turned at random: their differences tell the error
DIRECTIONS = 16  # of a set
CELLS_PER_PIXEL = 2  # in each direction: what single beams leave is averaged over all of them
LEAST_CELLS = 128


def beam_irradiance(
    system: OpticalSystem, lens: Lens, screen: Screen, backend: Backend
) -> tuple[LightEstimate, SequentialFates]:
    """Return (irradiance through front and rear, W/mm^2, flux by fate).  backend : of double precision."""
    rng = np.random.default_rng(system.problem.run.seed)
    counts = [max(LEAST_CELLS, ceil(CELLS_PER_PIXEL * n)) for n in screen.pixels]
    fates: list[SequentialFates] = []

    def replicates() -> Iterator[tuple[NDArray[np.float64], float, float]]:
        for _ in range(REPLICATES):
            beams = system.source.beams(counts, DIRECTIONS, rng.uniform(0, 2 * pi))
            parts = [cell_irradiance(system, lens, screen, cells, backend) for cells in beams]
            by_fate = reduce(add, (part for _, part in parts))
            fates.append(by_fate)
            image = reduce(add, (image for image, _ in parts))
            yield image, by_fate.on_target, by_fate.off_target

    light = LightEstimate.of_replicates(replicates())
    return light, reduce(add, fates) / REPLICATES
