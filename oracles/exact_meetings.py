"""The first meeting of one ray with a graph in rational numbers.

Rays, knots and the coefficients of the tensor-product form are float64 numbers, taken exactly.  Between knot
lines f(t) = height of the surface - height of the ray is a polynomial with rational coefficients.  Its roots
are counted by Sturm's theorem and told apart by halving.

Source: S. Basu, R. Pollack, M.-F. Roy, Algorithms in Real Algebraic Geometry, section 2.2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from oracles.first_meetings import BEHIND, MEETS, MISSES, tensor_net
from thbcad import FreeformSurface, KnotVector

WIDTH = Fraction(1, 1 << 40)  # mm, of the interval that holds a meeting

Polynomial = list[Fraction]  # of t, the constant first


class ExactGraph:
    """z = (x^2 + y^2) / 2R + spline."""

    def __init__(self, surface: FreeformSurface) -> None:
        self._knots, net = tensor_net(surface)
        self._net = [[Fraction(c) for c in row] for row in net.tolist()]
        self._half = [Fraction(h) for h in surface.half_width]
        self._bend = Fraction(0) if surface.conic.is_plane else 1 / (2 * Fraction(surface.conic.radius))
        self._least = min(self._bend, 0) * sum(h * h for h in self._half)
        self._top = max(map(max, self._net)) + max(self._bend, 0) * sum(h * h for h in self._half) + 1

    def first_meeting(
        self, origin: NDArray[np.float64], direction: NDArray[np.float64]
    ) -> tuple[int, Fraction, Fraction]:
        """Return (fate, low, high) of a ray that rises towards +z, (3,) each.

        The first meeting lies between low and high, mm along the ray; both are zero unless the fate is MEETS.
        """
        o, d = ([Fraction(a) for a in v.tolist()] for v in (origin, direction))
        first, last = self._span(o, d)
        if not first < last:
            return MISSES, Fraction(0), Fraction(0)
        begins = True
        for low, high, f in self._pieces(o, d, first, last):
            if begins and _value(f, low) < 0:
                return BEHIND, Fraction(0), Fraction(0)
            begins = False
            found = _first_root(f, low, high)
            if found is not None:
                return MEETS, *found
        return MISSES, Fraction(0), Fraction(0)

    def _span(self, o: Sequence[Fraction], d: Sequence[Fraction]) -> tuple[Fraction, Fraction]:
        first, last = Fraction(0), (self._top - o[2]) / d[2]
        for s, v, half in zip(o, d, self._half):
            if v:
                ends = sorted([(-half - s) / v, (half - s) / v])
                first, last = max(first, ends[0]), min(last, ends[1])
            elif abs(s) > half:
                return Fraction(0), Fraction(0)
        return first, last

    def _pieces(
        self, o: Sequence[Fraction], d: Sequence[Fraction], first: Fraction, last: Fraction
    ) -> Iterator[tuple[Fraction, Fraction, Polynomial]]:
        """Yield (low, high, f) between knot lines that the ray crosses, of the first one and where it may meet
        the surface."""
        lines = {first, last}
        for s, v, kv in zip(o, d, self._knots):
            if v:
                lines |= {t for t in ((Fraction(b) - s) / v for b in kv.breaks.tolist()) if first < t < last}
        ends = sorted(lines)
        for low, high in pairwise(ends):
            middle = (low + high) / 2
            spans = [_span_of(kv, s + middle * v) for kv, s, v in zip(self._knots, o, d)]
            if low == first or o[2] + high * d[2] >= self._lowest(spans):
                yield low, high, self._along(o, d, spans)

    def _lowest(self, spans: Sequence[int]) -> Fraction:
        """Return a height below the surface within a cell."""
        rows, columns = (slice(span - kv.degree, span + 1) for kv, span in zip(self._knots, spans))
        return min(min(row[columns]) for row in self._net[rows]) + self._least

    def _along(self, o: Sequence[Fraction], d: Sequence[Fraction], spans: Sequence[int]) -> Polynomial:
        """Return f within a cell.  spans : the knots at its left ends."""
        axes = [_basis(kv, span, s, v) for kv, span, s, v in zip(self._knots, spans, o, d)]
        (x, y, z), (dx, dy, dz) = o, d
        f = [self._bend * (x * x + y * y) - z, 2 * self._bend * (x * dx + y * dy) - dz]
        f.append(self._bend * (dx * dx + dy * dy))
        first = [span - kv.degree for kv, span in zip(self._knots, spans)]
        for i, a in enumerate(axes[0]):
            row: Polynomial = []
            for j, b in enumerate(axes[1]):
                row = _sum(row, [self._net[first[0] + i][first[1] + j] * c for c in b])
            f = _sum(f, _product(a, row))
        return f


def _span_of(kv: KnotVector, x: Fraction) -> int:
    """Return the number of the last knot that is not above x."""
    return int(np.clip(sum(Fraction(k) <= x for k in kv.knots.tolist()) - 1, kv.degree, kv.dim - 1))


def _basis(kv: KnotVector, span: int, s: Fraction, v: Fraction) -> list[Polynomial]:
    """Return the p + 1 B-splines that act on a span as polynomials of t, at s + v t: Cox and de Boor."""
    knots, p = [Fraction(k) for k in kv.knots.tolist()], kv.degree
    rows: list[Polynomial] = [[Fraction(1)]]
    for k in range(1, p + 1):
        after: list[Polynomial] = [[] for _ in range(k + 1)]
        for r, b in enumerate(rows):
            left, right = knots[span - k + 1 + r], knots[span + 1 + r]
            rising = [(s - left) / (right - left), v / (right - left)]
            falling = [1 - rising[0], -rising[1]]
            after[r], after[r + 1] = _sum(after[r], _product(falling, b)), _product(rising, b)
        rows = after
    return rows


def _first_root(f: Polynomial, low: Fraction, high: Fraction) -> tuple[Fraction, Fraction] | None:
    """Return an interval that holds the first root of f in (low, high], where f falls below zero there.

    None stands for no root, or for roots at which f does not change its sign.
    """
    chain = _sturm(f)
    while roots := _roots(chain, low, high):
        if roots == 1 and high - low < WIDTH:
            return (low, high) if _value(f, high) <= 0 else None
        middle = (low + high) / 2
        if _roots(chain, low, middle):
            high = middle
        else:
            low = middle
    return None


def _sturm(f: Polynomial) -> list[Polynomial]:
    """Return Sturm's chain of a polynomial: f, f', and remainders with their signs turned."""
    chain = [_trimmed(f), _trimmed([k * c for k, c in enumerate(f)][1:])]
    while len(chain[-1]) > 1:
        chain.append(_trimmed([-c for c in _remainder(chain[-2], chain[-1])]))
    return [c for c in chain if c]


def _roots(chain: list[Polynomial], low: Fraction, high: Fraction) -> int:
    """Return how many different roots lie in (low, high]."""
    counts = []
    for t in (low, high):
        signs = [value > 0 for value in (_value(c, t) for c in chain) if value]
        counts.append(sum(a != b for a, b in pairwise(signs)))
    return counts[0] - counts[1]


def _value(f: Polynomial, t: Fraction) -> Fraction:
    value = Fraction(0)
    for c in reversed(f):
        value = value * t + c
    return value


def _sum(a: Polynomial, b: Polynomial) -> Polynomial:
    size = max(len(a), len(b))
    a, b = (c + [Fraction(0)] * (size - len(c)) for c in (a, b))
    return [x + y for x, y in zip(a, b)]


def _product(a: Polynomial, b: Polynomial) -> Polynomial:
    out = [Fraction(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            out[i + j] += x * y
    return out


def _remainder(a: Polynomial, b: Polynomial) -> Polynomial:
    a = list(a)
    while len(a) >= len(b):
        factor, shift = a[-1] / b[-1], len(a) - len(b)
        a = [c - (factor * b[k - shift] if k >= shift else 0) for k, c in enumerate(a)][:-1]
    return a


def _trimmed(f: Polynomial) -> Polynomial:
    while f and not f[-1]:
        f = f[:-1]
    return f
