"""How near light that is made of images of the source can come to a target: a lower bound of rel_l2.

A lens throws an image of the source on the target through every point of its rear aperture.  The irradiance
is the sum of these images.  Let them be uniform rectangles along x and y with the source's proportions, all
of one size of at least w_x by w_y pixels (a shift-invariant system, thesis 7.1).  Then the irradiance is a
sum of whole-pixel boxes with weights that are not negative:

- an image with sides c w is one of 1 <= c < 2, or several of those side by side;
- a rectangle between pixels is a mean of four boxes (`KernelStack.boxes`);
- the same four boxes serve from one step of floor(c w_x), floor(c w_y) to the next.

The least of the bounds of all steps holds for all sizes from w on.

Merging pixels is a projection P: ||E - G|| >= ||P E - P G||.  So a bound on merged pixels times ||P G|| /
||G|| holds too.  A source of another form blurs by its own picture at the size w, centred on pixels; that
bound holds for this size alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, floor

import numpy as np

from optics.etendue.approximation import Approximation, approximate
from optics.etendue.kernel import Array, Kernel, PixelBlur, Real
from optics.etendue.kernel_stack import KernelStack, stack_approximation
from optics.sources import Profile
from thbcad.checks import EPS

SUBPIXELS = 16  # in each direction, where the picture of a source is drawn
MOST_STEPS = 5000
# pixels merged and KKT residual: tried first where a weak bound will do
QUICK = ((2, 1e-3), (1, 1e-3), (1, 1e-4))


@dataclass(frozen=True, eq=False)
class ImageBound:
    """A lower bound of rel_l2, and the irradiance that comes next to it.

    lower_bound : ||E - G|| / ||G|| that no such irradiance goes below, of all pixels
    attained : ||E - G|| / ||G|| of the solver's irradiance, of all pixels
    kkt : the solver's relative KKT residual
    merged : pixels merged in each direction
    sizes : number of image sizes that were tried
    target, image, kernel : the target irradiance, the solver's and the (mean) image of the source, on merged
        pixels
    """

    lower_bound: float
    attained: float
    kkt: float
    merged: int
    sizes: int
    target: Array
    image: Real
    kernel: Array


def image_bound(
    target: Array, width: Sequence[float], profile: Profile, merge: int = 1, finest: float = 1e-5
) -> ImageBound:
    """Return the ImageBound for images of a source at least `width` pixels wide and high.

    target : (rows, columns), the target irradiance, not negative
    profile : of the source over its area
    merge : pixels merged in each direction; the bound becomes weaker and stays true
    finest : KKT residual at which the solver stops
    """
    size = width[1], width[0]
    goal = _merged(target, merge)
    if max(size) < 2 * merge or not goal.any():  # single pixels are not excluded, and make every target
        return ImageBound(
            lower_bound=0.0,
            attained=0.0,
            kkt=0.0,
            merged=merge,
            sizes=0,
            target=goal,
            image=goal,
            kernel=np.ones((1, 1)),
        )
    sizes = _sizes(size, merge, goal.shape) if profile.kind == "uniform" else [size]
    least = _solved(target, sizes[0], profile, merge, finest)
    for other in sizes[1:]:
        for coarser, tolerance in (*QUICK, (1, finest)):
            new = _solved(target, other, profile, coarser * merge, max(tolerance, finest))
            if new.lower_bound >= least.lower_bound:
                break
        else:
            least = new
    return replace(least, sizes=len(sizes))


def _sizes(size: tuple[float, float], merge: int, shape: tuple[int, ...]) -> list[tuple[float, float]]:
    """Return the sizes c size, 1 <= c < 2, at which the boxes change, with the first.

    shape : of the merged target
    """
    steps = {1.0} | {
        merge * j / side for side in size for j in range(floor(side / merge) + 1, ceil(2 * side / merge))
    }
    sizes = [(c * size[0], c * size[1]) for c in sorted(steps)]
    return list({_boxes(pair, merge, shape): pair for pair in reversed(sizes)}.values())[::-1]


def _boxes(size: tuple[float, float], merge: int, shape: tuple[int, ...]) -> tuple[int, int]:
    """Return the rows and columns of the least box for images of a size.

    A box larger than the target looks from within like several side by side.  Rounding must not shorten
    c side.
    """
    rows, columns = (max(1, min(n - 2, floor(side / merge * (1 + 4 * EPS)))) for side, n in zip(size, shape))
    return rows, columns


def _solved(
    target: Array, size: tuple[float, float], profile: Profile, merge: int, tolerance: float
) -> ImageBound:
    """Return the ImageBound of images from one size to the next, of rows and columns of unmerged pixels."""
    goal = _merged(target, merge)
    scale = merge * float(np.linalg.norm(goal) / np.linalg.norm(target))
    kernel: PixelBlur
    best: Approximation
    if profile.kind == "uniform":
        kernel = KernelStack.boxes(*_boxes(size, merge, goal.shape))
        best, bound = stack_approximation(kernel, goal, tolerance, MOST_STEPS)
    else:
        kernel = _picture(profile, size[0] / merge, size[1] / merge, goal.shape)
        best = approximate(kernel, goal, tolerance, MOST_STEPS)
        bound = best.lower_bound
    return ImageBound(
        lower_bound=scale * bound,
        attained=scale * best.residual,
        kkt=best.kkt,
        merged=merge,
        sizes=1,
        target=goal,
        image=best.image,
        kernel=kernel.weights,
    )


def _picture(profile: Profile, high: float, wide: float, shape: tuple[int, ...]) -> Kernel:
    """Return the picture of a source, high x wide pixels, as a kernel no larger than an image of this shape.

    It is turned by 180 degrees, as by a pinhole.
    """
    rows, columns = (
        min(2 * ceil((side - 1) / 2) + 1, (n - 1) // 2 * 2 + 1) for side, n in zip((high, wide), shape)
    )
    t = ((2 * np.arange(rows * SUBPIXELS) + 1) / SUBPIXELS - rows) / high
    s = (columns - (2 * np.arange(columns * SUBPIXELS) + 1) / SUBPIXELS) / wide
    inside = (np.abs(t) < 1)[:, None] & (np.abs(s) < 1)[None, :]
    fine = np.where(inside, profile(np.clip(s, -1, 1)[None, :], np.clip(t, -1, 1)[:, None]), 0.0)
    return Kernel(fine.reshape(rows, SUBPIXELS, columns, SUBPIXELS).mean(axis=(1, 3)))


def _merged(image: Array, merge: int) -> Array:
    """Return the means of merge x merge pixels.

    Rows and columns left over at the end are dropped, which is a projection too.
    """
    rows, columns = (n // merge for n in image.shape)
    return image[: rows * merge, : columns * merge].reshape(rows, merge, columns, merge).mean(axis=(1, 3))
