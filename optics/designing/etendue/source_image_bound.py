"""One blur everywhere: how near light made of alike images of the source can come to a target, in rel_l2.

A lens throws an image of the source on the target through every point of its rear aperture.  The irradiance
is the sum of these images.  Let them all be alike: uniform rectangles along x and y of one height h and one
width w (a shift-invariant system, thesis 7.1).  This is a model that smooth, slowly varying lenses resemble.
It is no bound for lenses: etendue bounds the mean of the images' areas only, and images of different sizes do
better.  Then the irradiance is a sum of whole-pixel boxes with weights that are not negative:

- an image with sides c w is one of 1 <= c < 2, or several of those side by side;
- a rectangle between pixels is a mean of four boxes (`KernelStack.boxes`);
- the same four boxes serve from one step of floor(c w_x), floor(c w_y) to the next;
- a box larger than the target looks from within like several.

In the source's proportions the least of the bounds of all steps holds for all sizes from w on.  For images of
an area of at least a in any proportions see `any_proportions`.

Merging pixels is a projection P: ||E - G|| >= ||P E - P G||.  So a bound on merged pixels times ||P G|| /
||G|| holds too.  A source of another form blurs by its own picture at the size w, centred on pixels; that
bound holds for this size alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from math import ceil, floor, inf, log2, sqrt

import numpy as np

from optics.designing.etendue.approximation import approximate
from optics.designing.etendue.kernel import Kernel, Real
from optics.designing.etendue.kernel_stack import KernelStack, stack_approximation
from optics.scene.sources import Profile
from thbcad.checks import EPS, Floats

SUBPIXELS = 16  # in each direction, where the picture of a source is drawn
MOST_STEPS = 5000
# pixels merged and KKT residual: tried first where a weak bound will do
QUICK = ((2, 1e-3), (1, 1e-3), (1, 1e-4))
COARSEST = 2.0  # merged pixels across a square image, at least, in the first step of `any_proportions`
ROUGH = 1e-3  # KKT residual that tells where to search on
MOST_SOLUTIONS = 300  # of a search, which ends after some tens as a rule
LARGEST = 3.0  # images of any proportions as large as a square of the target's width over this, at most
OUTWARD = 4 * EPS  # rounding of quotients must not leave out a box

Cell = tuple[bool, int, int]  # whether the long side is the height; short and long side, merged pixels
Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class ImageBound:
    """A lower bound of rel_l2, and the irradiance that comes next to it.

    lower_bound : ||E - G|| / ||G|| that no such irradiance goes below, of all pixels
    attained : ||E - G|| / ||G|| of the solver's irradiance, of all pixels
    kkt : the solver's relative KKT residual
    merged : pixels merged in each direction
    sizes : number of image sizes, or of their ranges, that were tried
    target, image, kernel : the target irradiance, the solver's and the (mean) image of the source, on merged
        pixels
    """

    lower_bound: float
    attained: float
    kkt: float
    merged: int
    sizes: int
    target: Floats
    image: Real
    kernel: Floats


def image_bound(
    target: Floats, width: Sequence[float], profile: Profile, merge: int = 1, finest: float = 1e-5
) -> ImageBound:
    """Return the ImageBound for images of a source at least `width` pixels wide and high.

    target : (rows, columns), the target irradiance, not negative
    profile : of the source over its area
    merge : pixels merged in each direction; the bound becomes weaker and stays true
    finest : KKT residual at which the solver stops
    """
    size = width[1], width[0]
    goal = merged(target, merge)
    if max(size) < 2 * merge or not goal.any():
        return _no_bound(goal, merge)
    sizes = [size]
    if profile.kind == "uniform":  # the sizes c size, 1 <= c < 2, at which the boxes change, with the first
        steps = {1.0} | {
            merge * j / side for side in size for j in range(floor(side / merge) + 1, ceil(2 * side / merge))
        }
        scaled = [(c * size[0], c * size[1]) for c in sorted(steps, reverse=True)]
        sizes = list({_boxes(pair, merge, goal.shape): pair for pair in scaled}.values())[::-1]
    least = _solved(target, _blur(sizes[0], profile, merge, goal.shape), merge, finest)
    for other in sizes[1:]:
        for coarser, tolerance in (*QUICK, (1, finest)):
            pixels = coarser * merge
            blur = _blur(other, profile, pixels, merged(target, pixels).shape)
            new = _solved(target, blur, pixels, max(tolerance, finest))
            if new.lower_bound >= least.lower_bound:
                break
        else:
            least = new
    return replace(least, sizes=len(sizes))


def any_proportions(
    target: Floats, area: float, merge: int = 1, finest: float = 1e-5, most: int = MOST_SOLUTIONS
) -> ImageBound:
    """Return the ImageBound for uniform rectangles of one size, at least an area in square pixels.

    An image of the area 2 a or more is two of half its width.  So the short side s is at most sqrt(2 a), and
    s in [i, j] leaves a long side of a / j at least.  Images twice as long are two side by side: the long
    sides from a / j to 2 a / j stand for all, each for its multiples by powers of two.  Branch and bound: the
    cell of the least bound is divided on finer pixels, or solved more exactly, until a cell of the last step
    has the least.  The least bound of the cells at hand holds at any time.

    most : solutions, after which the search ends with a weaker bound

    Source: A. H. Land, A. G. Doig, Econometrica 28 (1960).
    """
    goal = merged(target, merge)
    area = min(area * (1 - OUTWARD), (min(target.shape) / LARGEST) ** 2)
    if area < (2 * merge) ** 2 or not goal.any():
        return _no_bound(goal, merge)
    doublings = floor(log2(sqrt(area) / merge / COARSEST))
    steps = [(merge << k, ROUGH) for k in range(doublings, -1, -1)] + [(merge, finest)]
    queue: list[tuple[float, float, int, Cell, ImageBound]] = []
    solved: set[tuple[int, Cell]] = set()
    step, least, sides = 0, 0.0, [(tall, (0.0, inf), (merge / 2, inf)) for tall in (True, False)]
    while True:
        pixels, tolerance = steps[step]
        cells = {cell for part in sides for cell in _cells(part, target.shape, pixels, area)}
        for cell in sorted(cells - {c for s, c in solved if s == step}):
            tall, short, long = cell
            boxes = KernelStack.boxes(long, short) if tall else KernelStack.boxes(short, long)
            found = _solved(target, boxes, pixels, tolerance)
            heappush(queue, (max(least, found.lower_bound), found.attained, -step, cell, found))
            solved.add((step, cell))
        least, _, negative, cell, found = heappop(queue)
        step = 1 - negative
        if step == len(steps) or len(solved) >= most:
            return replace(found, lower_bound=least, sizes=len(solved))
        sides = [_sides(cell, target.shape, steps[step - 1][0], area)]


def _cells(
    part: tuple[bool, Interval, Interval], shape: tuple[int, ...], merge: int, area: float
) -> Iterator[Cell]:
    """Yield the cells of merged pixels that hold a part of all sizes.

    part : whether the long side is the height; bounds of the short and of the long side, pixels
    """
    tall, (s0, s1), (l0, l1) = part
    largest = _largest(shape[0 if tall else 1], merge)
    end = ceil(min(s1, sqrt(2 * area)) / merge * (1 + OUTWARD))
    for short in range(max(1, floor(s0 / merge)), max(2, end)):
        least = area / ((short + 1) * merge)
        for k in range(max(0, ceil(log2(2 * least / l0)) + 1)):
            low, high = max(l0 * 2**k, least), min(l1 * 2**k, 2 * least)
            if low <= high:
                first, end = floor(low / merge * (1 - OUTWARD)), ceil(high / merge * (1 + OUTWARD))
                yield from ((tall, short, max(1, min(long, largest))) for long in range(first, end))


def _sides(cell: Cell, shape: tuple[int, ...], merge: int, area: float) -> tuple[bool, Interval, Interval]:
    """Return the part of all sizes that belongs to a cell, in pixels.

    The least box makes all narrower images too, the largest all longer ones.
    """
    tall, short, long = cell
    s1, l1 = (short + 1.0) * merge, (long + 1.0) * merge
    if long == _largest(shape[0 if tall else 1], merge):
        l1 = inf
    return (
        tall,
        (0.0 if short == 1 else float(short * merge), s1),
        (max(area / s1, long * merge if long > 1 else 0.0), l1),
    )


def _largest(pixels: int, merge: int) -> int:
    """Return the length of the largest box in merged pixels.

    It and the next one make everything larger.
    """
    return max(1, pixels // merge - 2)


def _no_bound(goal: Floats, merge: int) -> ImageBound:
    """Return the bound 0 of single pixels, which make every target."""
    return ImageBound(0.0, 0.0, 0.0, merge, 0, goal, goal, np.ones((1, 1)))


def _boxes(size: tuple[float, float], merge: int, shape: tuple[int, ...]) -> tuple[int, int]:
    """Return the rows and columns of the least box for images of a size.

    A box larger than the target looks from within like several side by side.  Rounding must not shorten
    c side.
    """
    rows, columns = (max(1, min(n - 2, floor(side / merge * (1 + 4 * EPS)))) for side, n in zip(size, shape))
    return rows, columns


def _blur(
    size: tuple[float, float], profile: Profile, merge: int, shape: tuple[int, ...]
) -> KernelStack | Kernel:
    """Return the blur by images from one size to the next, of rows and columns of unmerged pixels.

    shape : of the merged target
    """
    if profile.kind == "uniform":
        return KernelStack.boxes(*_boxes(size, merge, shape))
    # its picture, turned by 180 degrees, as by a pinhole
    high, wide = (side / merge for side in size)
    rows, columns = (
        min(2 * ceil((side - 1) / 2) + 1, (n - 1) // 2 * 2 + 1) for side, n in zip((high, wide), shape)
    )
    t = ((2 * np.arange(rows * SUBPIXELS) + 1) / SUBPIXELS - rows) / high
    s = (columns - (2 * np.arange(columns * SUBPIXELS) + 1) / SUBPIXELS) / wide
    inside = (np.abs(t) < 1)[:, None] & (np.abs(s) < 1)[None, :]
    fine = np.where(inside, profile(np.clip(s, -1, 1)[None, :], np.clip(t, -1, 1)[:, None]), 0.0)
    return Kernel(fine.reshape(rows, SUBPIXELS, columns, SUBPIXELS).mean(axis=(1, 3)))


def _solved(target: Floats, blur: KernelStack | Kernel, merge: int, tolerance: float) -> ImageBound:
    """Return the ImageBound of one blur of merged pixels."""
    goal = merged(target, merge)
    scale = merge * float(np.linalg.norm(goal) / np.linalg.norm(target))
    if isinstance(blur, KernelStack):
        best, bound = stack_approximation(blur, goal, tolerance, MOST_STEPS)
    else:
        best = approximate(blur, goal, tolerance, MOST_STEPS)
        bound = best.lower_bound
    return ImageBound(
        lower_bound=scale * bound,
        attained=scale * best.residual,
        kkt=best.kkt,
        merged=merge,
        sizes=1,
        target=goal,
        image=best.image,
        kernel=blur.weights,
    )


def merged(image: Floats, merge: int) -> Floats:
    """Return the means of merge x merge pixels.

    Rows and columns left over at the end are dropped, which is a projection too.
    """
    rows, columns = (n // merge for n in image.shape)
    return image[: rows * merge, : columns * merge].reshape(rows, merge, columns, merge).mean(axis=(1, 3))
