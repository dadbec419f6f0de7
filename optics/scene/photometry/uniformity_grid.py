"""How uniform light is where the target is uniform, judged on a grid of boxes as lighting engineers do.

The bounding rectangle of the lit region is cut into n x n equal boxes.  E_k is the mean light of box k: its
flux over its area, measured on the box itself and not summed up from pixels.  The boxes count that lie in the
region with a margin taken off along its border, where blurred light must fall:

    U0 = min E_k / mean E_k,      diversity = min E_k / max E_k,      rsd = std E_k / mean E_k.

Noise lowers the least value of many boxes.  So one half of the replicates choose the darkest and the
brightest box, and the other half measure them, in turns (`crossed_choice`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import hypot, sqrt

import numpy as np

from optics.base.statistics import (
    crossed_choice,
    crossed_error,
    drift_error,
    drift_signs,
    root_error,
    standard_error,
    unbiased_square,
)
from optics.scene.photometry.lit_region import RASTER, LitRegion
from thbcad.checks import Bools, Floats

GRID = 21  # boxes in each direction
MARGIN = 0.025  # of the shorter side of the bounding rectangle
LEAST_LEFT = 0.5  # of the region: with less in the boxes there is no verdict


@dataclass(frozen=True, eq=False)
class Uniformity:
    """How uniform light is on boxes.

    mean : over the boxes, in the unit of the light.  min_over_mean (U0), min_over_max, rsd : None where
        nothing can be said; the reason says why.
    min_over_mean_error, min_over_max_error, rsd_error : of these, as standard deviations.
    grid : boxes in each direction.  box : width and height of one.  boxes : how many count.
    left : share of the region that they cover.  noise : the greatest of a box, relative to the mean light.
    """

    mean: float
    grid: int
    box: tuple[float, float]
    boxes: int
    left: float
    margin: float
    noise: float = 0.0
    min_over_mean: float | None = None
    min_over_mean_error: float = 0.0
    min_over_max: float | None = None
    min_over_max_error: float = 0.0
    rsd: float | None = None
    rsd_error: float = 0.0
    reason: str = ""


@dataclass(frozen=True, eq=False)
class BoxGrid:
    """Boxes on the bounding rectangle of a region.

    grid : boxes in each direction.  blur : rms in one direction of the light that a point of the lens sends,
    mm or degrees.
    """

    region: LitRegion
    grid: int = GRID
    blur: float = 0.0

    @property
    def margin(self) -> float:
        """Width that is left out along the border of the region."""
        return max(MARGIN * min(self.region.size), self.blur)

    @property
    def counting(self) -> Bools:
        """The boxes that lie wholly in the region without its margin, (rows, columns), row 0 at +y."""
        within = self.region.inside & (self.region.depth >= self.margin * (1 - 1e-9))
        edges = np.arange(self.grid + 1) / self.grid * RASTER
        first, last = np.floor(edges[:-1] + 1e-9).astype(int), np.ceil(edges[1:] - 1e-9).astype(int)
        sums = np.pad((~within).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))  # of cells above and before
        above, before = sums[np.ix_(first, last)], sums[np.ix_(last, first)]
        return np.asarray(sums[np.ix_(last, last)] - above - before + sums[np.ix_(first, first)] == 0)

    def without_light(self) -> Uniformity:
        """Return the boxes alone, with the reason if too few of them count for a verdict."""
        counting, region = self.counting, self.region
        left = float(counting.mean() / region.inside.mean()) if region.inside.any() else 0.0
        box = region.size[0] / self.grid, region.size[1] / self.grid
        found = Uniformity(0.0, self.grid, box, int(counting.sum()), left, self.margin)
        if left >= LEAST_LEFT:
            return found
        reason = (
            f"a margin of {self.margin:.3g}, the larger of {MARGIN:.1%} of the region's shorter side and the "
            f"blur, leaves boxes on {left:.0%} of the region; smaller boxes (verify.grid) may leave more"
        )
        return replace(found, reason=reason)

    def uniformity(self, draws: Floats, drift: Floats | float = 0.0) -> Uniformity:
        """Return how uniform light is.

        draws : (R, grid, grid), independent measurements of the mean light of all boxes, row 0 at +y.
        drift : (grid, grid), an error that they have in common, of known size about.
        """
        found = self.without_light()
        if found.reason:
            return found
        counting = self.counting
        light, mean = draws[:, counting], float(draws[:, counting].mean())
        if mean <= 0:
            return replace(found, reason="the region is dark")
        means = light.mean(axis=1, keepdims=True)
        relative = light / (means if (means > 0).all() else mean)
        drifts = [
            np.broadcast_to(signs * drift / mean, counting.shape)[counting]
            for signs in drift_signs(counting.shape)
        ]
        return _judged(replace(found, mean=mean), relative, np.stack(drifts))


def _judged(found: Uniformity, light: Floats, drifts: Floats) -> Uniformity:
    """Return the ratios of boxes and their errors.

    light : (R, boxes), replicates of mean 1.  drifts : (4, boxes), as they may come, see `drift_signs`.
    """
    replicates, low, high = np.arange(len(light)), *(crossed_choice(light, f) for f in (np.argmin, np.argmax))
    darkest, brightest = light[replicates, low], light[replicates, high]
    mean = light.mean(axis=0)
    square, variance = unbiased_square((light - 1) / sqrt(light.shape[1]))
    shifted = mean + drifts

    def error(of_noise: float, value: Callable[[Floats], Floats]) -> float:
        return hypot(of_noise, drift_error(value(mean), value(shifted)))

    ratio = float(darkest.mean() / brightest.mean())
    away = (darkest - ratio * brightest) / brightest.mean()
    return replace(
        found,
        noise=float(np.hypot(standard_error(light), np.abs(drifts[0])).max()),
        min_over_mean=float(darkest.mean()),
        min_over_mean_error=error(crossed_error(darkest, low), lambda e: e.min(axis=-1) / e.mean(axis=-1)),
        min_over_max=ratio,
        min_over_max_error=error(
            crossed_error(away, low + high * light.shape[1]), lambda e: e.min(axis=-1) / e.max(axis=-1)
        ),
        rsd=sqrt(max(square, 0.0)),
        rsd_error=error(root_error(square, variance), lambda e: e.std(axis=-1) / e.mean(axis=-1)),
    )
