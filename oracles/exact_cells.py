"""Light of mapped cells in exact rational numbers: every triangle is clipped to every pixel.

A cell with corners 0, 1 (towards j + 1), 2 (towards i + 1) and 3 becomes the triangles (0, 2, 3) and
(0, 3, 1), a turned one (0, 2, 1) and (1, 2, 3), each with half of what arrives of the cell's flux.  A
triangle lights a pixel with the part of its area that lies there; one of less than LEAST_AREA with the part
of its longest edge, where it is as thick as the triangle: from nothing at both ends to the most beside the
third corner.  Positions are taken as the binary fractions that they are, in pixel units: a along the rows,
downwards, b along the columns.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import product
from math import ceil, floor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from optics.scene.receivers import Screen

LEAST_AREA = Fraction(1e-9)  # square pixels
STEP = Fraction(1, 1 << 100)  # of the derivatives, mm

Point = tuple[Fraction, Fraction]
Triangle = tuple[tuple[Point, Point, Point], Fraction]  # corners, flux
Exact = NDArray[np.object_]
Floats = NDArray[np.float64]


def exact_image(
    screen: Screen,
    x: ArrayLike,
    y: ArrayLike,
    emitted: ArrayLike,
    passing: ArrayLike | None = None,
    turned: ArrayLike | None = None,
) -> Exact:
    """Return the flux in every pixel, (rows, columns) with margin, Fractions in W.

    x, y : (nx + 1, ny + 1) corners on the target.  emitted : (nx, ny) W.
    passing : (nx + 1, ny + 1) fraction of the corners' flux that arrives, NaN where a corner is not sound;
        left out, all of it.
    turned : (nx, ny) cells that are split along the other diagonal; left out, none.
    """
    rows, columns = screen.padded
    image = np.full((rows, columns), Fraction(0), dtype=object)
    for corners, flux in triangles(screen, x, y, emitted, passing, turned):
        area = signed_area(corners)
        whole = abs(area) >= LEAST_AREA
        turned = ((corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]) for k in range(3))
        edge = corners if whole else max(turned, key=_square)  # of equal ones the first
        for i in _touched([p[0] for p in corners], rows):
            for j in _touched([p[1] for p in corners], columns):
                part = area_within(corners, i, j) / area if whole else thickness_within(edge, i, j)
                image[i, j] += flux * part
    return image


def exact_slopes(
    screen: Screen,
    x: Floats,
    y: Floats,
    emitted: Floats,
    weights: Floats,
    turned: NDArray[np.bool_] | None = None,
) -> list[Exact]:
    """Return the derivatives of the sum of weights times `exact_image` by x and by y, (nx + 1, ny + 1) each.

    They are central differences in exact numbers, whose error is the square of STEP.
    """
    weights = np.vectorize(Fraction, otypes=[object])(weights)
    out = [np.full(x.shape, Fraction(0), dtype=object) for _ in range(2)]
    for axis, (i, j) in product(range(2), np.ndindex(x.shape)):
        near = slice(max(0, i - 1), i + 2), slice(max(0, j - 1), j + 2)  # corners of the cells around
        cells = slice(max(0, i - 1), i + 1), slice(max(0, j - 1), j + 1)
        values = []
        for step in (STEP, -STEP):
            moved = [x.astype(object), y.astype(object)]
            moved[axis][i, j] = Fraction(moved[axis][i, j]) + step
            others = None if turned is None else turned[cells]
            image = exact_image(screen, *(m[near] for m in moved), emitted[cells], None, others)
            values.append((weights * image).sum())
        out[axis][i, j] = (values[0] - values[1]) / (2 * STEP)
    return out


def triangles(
    screen: Screen,
    x: ArrayLike,
    y: ArrayLike,
    emitted: ArrayLike,
    passing: ArrayLike | None = None,
    turned: ArrayLike | None = None,
) -> Iterator[Triangle]:
    """Yield the corners in pixel units and the flux of all triangles that are lit."""
    (px, py), (hx, hy) = screen.pitch, screen.half_width
    passing = np.ones(np.shape(x)) if passing is None else np.asarray(passing)
    for (i, j), flux in np.ndenumerate(np.asarray(emitted)):
        four = [(i, j), (i, j + 1), (i + 1, j), (i + 1, j + 1)]
        if flux == 0 or any(np.isnan(passing[k]) for k in four):
            continue
        arrives = Fraction(flux) * sum(Fraction(passing[k]) for k in four) / 4
        points = [
            (
                (Fraction(hy) - Fraction(y[k])) / Fraction(py) + screen.margin,
                (Fraction(hx) + Fraction(x[k])) / Fraction(px) + screen.margin,
            )
            for k in four
        ]
        other = turned is not None and np.asarray(turned)[i, j]
        for three in ((0, 2, 1), (1, 2, 3)) if other else ((0, 2, 3), (0, 3, 1)):
            p, q, r = (points[k] for k in three)
            yield (p, q, r), arrives / 2


def signed_area(polygon: tuple[Point, ...] | list[Point]) -> Fraction:
    """Return the area of a polygon, positive where its corners turn from a to b."""
    pairs = zip(polygon, [*polygon[1:], *polygon[:1]])
    return sum((p[0] * q[1] - q[0] * p[1] for p, q in pairs), Fraction(0)) / 2


def area_within(polygon: tuple[Point, ...] | list[Point], i: int, j: int) -> Fraction:
    """Return the signed area of the part of a convex polygon that lies within pixel (i, j)."""
    part = list(polygon)
    for axis, first in ((0, i), (1, j)):
        part = _beyond(part, axis, Fraction(first), 1)
        part = _beyond(part, axis, Fraction(first + 1), -1)
    return signed_area(part) if part else Fraction(0)


def thickness_within(corners: tuple[Point, Point, Point], i: int, j: int) -> Fraction:
    """Return the part of a thin triangle on its first edge within pixel (i, j).

    The pixel has its lower borders and not the upper ones.
    """
    u, v, _ = corners
    start, end = Fraction(0), Fraction(1)
    for a, b, first in zip(u, v, (i, j)):
        if a == b:
            if floor(a) != first:
                return Fraction(0)
            continue
        low, high = sorted([(first - a) / (b - a), (first + 1 - a) / (b - a)])
        start, end = max(start, low), min(end, high)
    return _up_to(corners, end) - _up_to(corners, start) if end > start else Fraction(0)


def _up_to(corners: tuple[Point, Point, Point], t: Fraction) -> Fraction:
    """Return the part of a thin triangle before u + t (v - u)."""
    u, v, w = corners
    square = _square(corners)
    if square == 0:
        return t
    widest = sum(((c - a) * (b - a) for a, b, c in zip(u, v, w)), Fraction(0)) / square
    if t < widest:
        return t * t / widest
    return 1 - (1 - t) ** 2 / (1 - widest) if widest < 1 else Fraction(1)


def _square(corners: tuple[Point, Point, Point]) -> Fraction:
    """Return the squared length of the first edge."""
    return sum(((u - v) ** 2 for u, v in zip(*corners[:2])), Fraction(0))


def _beyond(polygon: list[Point], axis: int, line: Fraction, sign: int) -> list[Point]:
    """Return the part of a convex polygon on one side of a line (Sutherland and Hodgman)."""
    heights = [sign * (point[axis] - line) for point in polygon]
    if all(height >= 0 for height in heights):
        return polygon
    out = []
    for k, (q, after) in enumerate(zip(polygon, heights)):
        p, before = polygon[k - 1], heights[k - 1]
        if before < 0 < after or after < 0 < before:
            t = before / (before - after)
            out.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
        if after >= 0:
            out.append(q)
    return out


def _touched(values: list[Fraction], count: int) -> range:
    """Return the pixels of a screen that coordinates span."""
    return range(max(0, floor(min(values))), min(count, ceil(max(values)) + 1))
