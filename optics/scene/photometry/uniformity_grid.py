"""How uniform light is where it is asked for, judged on a grid of boxes as lighting engineers do.

The bounding rectangle of the lit region is cut into n x n equal boxes.  E_k is the mean light of box k.  The
boxes count that lie in the region with a margin taken off along its border, where blurred light must fall:

    U0 = min E_k / mean E_k,      diversity = min E_k / max E_k,      rsd = std E_k / mean E_k.

Noise of rays lowers a minimum.  Where the noise of a box is above NOISE of the mean, or where a box is
smaller than a pixel, boxes are larger: every square of m x m boxes that all count is one, so that larger ones
overlap and still reach every corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, hypot, sqrt

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from optics.scene.photometry.lit_region import RASTER, LitRegion
from thbcad.checks import Floats

GRID = 21  # boxes in each direction
LARGEST = 7  # parts of the rectangle, one of which a box is at most: larger ones do not see a dark rim
MARGIN = 0.025  # of the shorter side of the bounding rectangle
LEAST_LEFT = 0.5  # of the region: with less in the boxes there is no verdict
NOISE = 0.01  # of the mean light: the most that a box may have


@dataclass(frozen=True, eq=False)
class Uniformity:
    """How uniform light is on boxes.

    mean : over the boxes, in the unit of the light.  min_over_mean (U0), min_over_max, rsd : None where
        nothing can be said; the reason says why.  few_pixels : pixels are larger than the largest boxes.
    min_over_mean_error, min_over_max_error, rsd_error : of these, as standard deviations.
    grid : boxes in each direction.  box : width and height of those that count; larger than those of the grid
        where noise asks for it.  boxes : how many count.  left : share of the region that they cover.
    noise : the greatest of a box, relative to the mean light.
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
    few_pixels: bool = False


def uniformity(
    light: Floats,
    region: LitRegion,
    half_width: tuple[float, float],
    noise: Floats | None = None,
    blur: float = 0.0,
    grid: int = GRID,
    axes: Sequence[int] = (),
    drift: Floats | float = 0.0,
) -> Uniformity:
    """Return how uniform light is in a region of the target.

    light : (rows, columns), means over pixels that tile |x| <= half_width[0], |y| <= half_width[1].
    noise : of it, as standard deviations, (rows, columns); None is no error.
    blur : rms in one direction of the light that a point of the lens sends, mm or degrees.
    grid : boxes in each direction; larger ones are taken where their noise is above NOISE.
    axes : 0 for x and 1 for y, of directions in which errors are their own mirror images.
    drift : an error that is no noise: it adds up over a box, and nothing is taken off for it.
    """
    margin = max(MARGIN * min(region.size), blur)
    pixel = 2 * half_width[0] / light.shape[1], 2 * half_width[1] / light.shape[0]
    for width in range(1, max(1, grid // LARGEST) + 1):
        found = _on_boxes(light, region, half_width, noise, margin, grid, width, axes, drift)
        wide = all(b >= p * (1 - 1e-9) for b, p in zip(found.box, pixel))
        if found.reason or (wide and found.noise <= NOISE):
            return found
    boxes = f"boxes of {found.box[0]:.3g} x {found.box[1]:.3g}"
    reason = f"the noise of {boxes} is {found.noise:.1%} of the mean"
    if not wide:
        finer = [max(n, ceil(n * p / b * (1 - 1e-9))) for n, p, b in zip(light.shape[::-1], pixel, found.box)]
        reason = (
            f"{boxes} are smaller than a pixel of {pixel[0]:.3g} x {pixel[1]:.3g}; "
            f"--set target.pixels=[{finer[0]},{finer[1]}] has smaller ones"
        )
    return replace(found, min_over_mean=None, min_over_max=None, rsd=None, reason=reason, few_pixels=not wide)


def _on_boxes(
    light: Floats,
    region: LitRegion,
    half_width: tuple[float, float],
    noise: Floats | None,
    margin: float,
    grid: int,
    width: int,
    axes: Sequence[int],
    drift: Floats | float,
) -> Uniformity:
    """Return the uniformity on all squares of width x width boxes of the grid."""
    # boxes that lie wholly within the margin count, where all of a square do
    within = region.inside & (region.depth >= margin * (1 - 1e-9))
    edges = np.arange(grid + 1) / grid * RASTER
    first, last = np.floor(edges[:-1] + 1e-9).astype(int), np.ceil(edges[1:] - 1e-9).astype(int)
    sums = np.pad((~within).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))  # of all cells above and before
    rows, columns = np.ix_(last, first), np.ix_(first, last)
    count = sums[np.ix_(last, last)] - sums[rows] - sums[columns] + sums[np.ix_(first, first)]
    kept = np.asarray(sliding_window_view(count == 0, (width, width)).all(axis=(2, 3)))
    box = width * region.size[0] / grid, width * region.size[1] / grid
    squares = sliding_window_view(np.pad(kept, width - 1), (width, width))
    covered = squares.any(axis=(2, 3)).sum() / grid**2
    left = float(covered / region.inside.mean()) if region.inside.any() else 0.0
    found = Uniformity(0.0, grid, box, int(kept.sum()), left, margin)
    if left < LEAST_LEFT:
        reason = (
            f"a margin of {margin:.3g}, the larger of {MARGIN:.1%} of the region's shorter side and the "
            f"blur, leaves boxes on {left:.0%} of the region; smaller boxes (verify.grid) may leave more"
        )
        return replace(found, reason=reason)
    by_row = _mean_of(_shares(light.shape[0], half_width[1], (-region.y[1], -region.y[0]), grid), width)
    by_column = _mean_of(_shares(light.shape[1], half_width[0], region.x, grid), width)
    means = (by_row @ light @ by_column.T)[kept]
    found = replace(found, mean=float(means.mean()))
    if found.mean <= 0:
        return replace(found, reason="the region is dark")
    means = np.maximum(means, 0.0) / found.mean
    if noise is None:
        return _judged(found, means, 0 * means, 0 * means, 0.0)
    drifts = (by_row @ (drift / found.mean * np.ones_like(light)) @ by_column.T)[kept]
    # pixels that are mirror images share their errors: in these the weights of all images add up
    by_row, by_column = (s + s[:, ::-1] if a in axes else s for a, s in ((1, by_row), (0, by_column)))
    images = 2 ** len(axes)
    pixels = np.square(noise / found.mean) / images
    noises = np.sqrt((by_row**2 @ pixels @ (by_column**2).T)[kept])
    away = np.zeros(kept.shape)
    away[kept] = means - 1
    of_squares = 4 * float(np.sum(np.square(by_row.T @ away @ by_column) * pixels))
    known = 2 * abs(float(np.sum((means - 1) * drifts))) + float(np.sum(drifts**2))
    variance = max(of_squares - 2 * images * float(np.sum(noises**4)), 0.0) + known**2
    return _judged(found, means, noises, drifts, variance)


def _mean_of(shares: Floats, width: int) -> Floats:
    """Return the shares of pixels in rows of `width` boxes, (grid - width + 1, pixels)."""
    return sliding_window_view(shares, width, axis=0).mean(axis=-1)


def _judged(found: Uniformity, means: Floats, noises: Floats, drifts: Floats, variance: float) -> Uniformity:
    """Return the ratios of boxes.

    means, noises, drifts : relative to the mean of all.  variance : of the sum of (means - 1)^2.
    """
    low, high, errors = int(means.argmin()), int(means.argmax()), np.hypot(noises, drifts)
    least, most, worst = float(means[low]), float(means[high]), float(errors.max())
    ratio, square = least / most, max(float(means.var()) - float(np.mean(noises**2)), 0.0)
    rsd = sqrt(square)
    rsd_error = sqrt(variance) / len(means) / 2 / rsd if rsd else worst
    return replace(
        found,
        noise=worst,
        min_over_mean=least,
        min_over_mean_error=float(errors[low]),
        min_over_max=ratio,
        min_over_max_error=hypot(float(errors[low]), ratio * float(errors[high])) / most,
        rsd=rsd,
        rsd_error=min(rsd_error, worst),
    )


def _shares(pixels: int, half: float, span: tuple[float, float], grid: int) -> Floats:
    """Return the share of each box that each pixel makes up along one direction, (grid, pixels).

    Pixels tile -half to half, boxes tile the span.
    """
    pixel = half * (2 * np.arange(pixels + 1) / pixels - 1)
    box = span[0] + (span[1] - span[0]) * np.arange(grid + 1) / grid
    low = np.maximum(box[:-1, None], pixel[None, :-1])
    high = np.minimum(box[1:, None], pixel[None, 1:])
    return np.maximum(high - low, 0.0) / ((span[1] - span[0]) / grid)
