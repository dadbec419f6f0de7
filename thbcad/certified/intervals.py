"""Enclosures of splines over rectangles, and the proof that a function is positive on a set of boxes.

On a rectangle within one cell a polynomial lies between its least and greatest Bernstein coefficient there,
which are polar forms at the ends of the rectangle.  A rectangle that meets several cells is cut along the
knots, so that derivatives may jump there.

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 14; R. E. Moore, R. B. Kearfott, M. J. Cloud,
Introduction to Interval Analysis, chapters 5 and 6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thbcad.certified.polynomial_cells import rounding
from thbcad.checks import Floats, Integers
from thbcad.splines import BSplineSurface, KnotVector, blossom_rows

STRIP = 2**15  # pieces of rectangles that are assessed at once
MOST_BOXES = 2**15  # about a second of work


@dataclass(frozen=True, eq=False)
class Interval:
    """Numbers between `low` and `high`, (n,) float each, with the arithmetic of intervals.

    Sums, products and quotients are rounded outward: ends are moved to the next float64, so that they enclose
    the true result of float64 operands, infinite ones excepted.
    """

    low: Floats
    high: Floats

    @classmethod
    def at(cls, number: Floats) -> Interval:
        """Return the intervals that hold one number each; number : (n,)."""
        return cls(number, number)

    @classmethod
    def rounded(cls, number: float, like: Floats) -> Interval:
        """Return enclosures of what one operation rounded to a number, as many as `like` has numbers."""
        return _outward(np.full_like(like, number), np.full_like(like, number))

    def __add__(self, other: Interval) -> Interval:
        return _outward(self.low + other.low, self.high + other.high)

    def __sub__(self, other: Interval) -> Interval:
        return _outward(self.low - other.high, self.high - other.low)

    def __mul__(self, other: Interval) -> Interval:
        corners = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return _outward(np.min(corners, axis=0), np.max(corners, axis=0))

    def __truediv__(self, other: Interval) -> Interval:
        """Return the quotients by intervals of positive numbers."""
        corners = [a / b for a in (self.low, self.high) for b in (other.low, other.high)]
        return _outward(np.min(corners, axis=0), np.max(corners, axis=0))

    def scaled(self, factor: float) -> Interval:
        """Return the products with one number."""
        ends = factor * self.low, factor * self.high
        return _outward(np.minimum(*ends), np.maximum(*ends))

    @property
    def magnitude(self) -> Floats:
        """The greatest absolute values, (n,)."""
        return np.maximum(-self.low, self.high)

    def clipped(self, low: float, high: float) -> Interval:
        """Return what lies between two numbers; what lies outside becomes the nearer one."""
        return Interval(np.clip(self.low, low, high), np.clip(self.high, low, high))


def _outward(low: Floats, high: Floats) -> Interval:
    return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def range_over(
    surface: BSplineSurface, u: Interval, v: Interval, orders: tuple[int, int] = (0, 0)
) -> Interval:
    """Return bounds of a value or derivative (orders 0 and 1) of a scalar surface over rectangles u x v
    inside its domain.  What rounding puts outside is cut off.

    They are the least and the greatest Bernstein coefficient on the rectangles, rounding included, and meet
    as these shrink.
    """
    vectors, (p, q) = surface.knot_vectors, (surface.kv_u.degree, surface.kv_v.degree)
    sides = [x.clipped(kv.start, kv.stop) for kv, x in zip(vectors, (u, v))]
    low, high = np.full(len(u.low), np.inf), np.full(len(u.low), -np.inf)
    (first_u, count_u), (first_v, count_v) = map(_spans, vectors, sides)
    count = count_u * count_v
    pieces = np.repeat(np.arange(len(low)), count)
    number = np.arange(len(pieces)) - np.repeat(np.cumsum(count) - count, count)
    for first in range(0, len(pieces), STRIP):
        owner = pieces[first : first + STRIP]
        k = number[first : first + STRIP]
        spans = first_u[owner] + k // count_v[owner], first_v[owner] + k % count_v[owner]
        (start_u, a), (start_v, b) = (
            _restricted(kv, Interval(x.low[owner], x.high[owner]), span, order)
            for kv, x, span, order in zip(vectors, sides, spans, orders)
        )
        net = surface.coefficients[
            start_u[:, None, None] + np.arange(p + 1)[:, None], start_v[:, None, None] + np.arange(q + 1)
        ]
        coefficients = np.matmul(np.matmul(a, net), b.transpose(0, 2, 1)).reshape(len(owner), -1)
        size = abs(a).sum(axis=2).max(axis=1) * abs(net).max(axis=(1, 2)) * abs(b).sum(axis=2).max(axis=1)
        error = rounding(8 * (p + q + 2), size)
        np.minimum.at(low, owner, coefficients.min(axis=1) - error)
        np.maximum.at(high, owner, coefficients.max(axis=1) + error)
    return Interval(low, high)


def positive(
    lower: Callable[[Interval, Interval], Floats], value: Callable[[Floats, Floats], Floats], boxes: Floats
) -> tuple[bool, Floats | None]:
    """Return (True, None) where bounds prove a function positive on boxes, (False, point) where it is not at
    a point (2,).

    After 2^15 boxes without proof or counterexample it returns (False, None).

    lower : (a, b) -> (n,), bounds of the function on n boxes a x b, inf where it is not asked for
    value : (a, b) -> (n,), the function at points, inf where it is not asked for
    boxes : (2, 2, n) float, box[0] the lower left corners, box[1] the upper right ones
    """
    spent = 0
    while boxes.shape[-1]:
        spent += boxes.shape[-1]
        if spent > MOST_BOXES:
            return False, None
        middle = boxes.mean(axis=0)
        values = value(*middle)
        if values.min() <= 0:
            return False, middle[:, np.argmin(values)]
        boxes = boxes[..., ~(lower(*(Interval(*boxes[:, axis]) for axis in (0, 1))) > 0)]
        for axis in (0, 1):
            if (boxes[0, axis] < boxes[1, axis]).any():
                low, high = boxes.copy(), boxes.copy()
                low[1, axis] = high[0, axis] = boxes[:, axis].mean(axis=0)
                boxes = np.concatenate([low, high], axis=-1)
    return True, None


def _spans(kv: KnotVector, x: Interval) -> tuple[Integers, Integers]:
    """Return the first non-empty span that every interval meets, and how many."""
    first = np.minimum(np.searchsorted(kv.breaks, x.low, "right") - 1, kv.spans - 1)
    last = np.maximum(np.searchsorted(kv.breaks, x.high, "left") - 1, first)
    return first, last - first + 1


def _restricted(kv: KnotVector, x: Interval, span: Integers, order: int) -> tuple[Integers, Floats]:
    """Return (first, rows): rows @ c[first : first + p + 1] are the Bernstein coefficients of a derivative on
    parts of intervals in a span.

    rows : (n, p + 1 - order, p + 1) float
    """
    p = kv.degree
    ends = np.stack([np.maximum(x.low, kv.breaks[span]), np.minimum(x.high, kv.breaks[span + 1])], axis=1)
    degree = p - order
    # coefficient k is the polar form at degree - k times the low end
    pattern = np.arange(p) >= degree - np.arange(degree + 1)[:, None]
    mu = np.searchsorted(kv.knots, kv.breaks[span], "right") - 1
    arguments = ends[:, pattern.astype(int)].reshape(-1, p)
    rows = blossom_rows(kv.knots, p, np.repeat(mu, degree + 1), arguments, order)
    return mu - p, rows.reshape(len(span), degree + 1, p + 1)
