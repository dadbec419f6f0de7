"""The first meeting of one ray with a graph in rational numbers.

Rays, knots and the coefficients of the tensor-product form are float64 numbers, taken exactly.  Between knot
lines f(t) = height of the surface - height of the ray is a polynomial with rational coefficients.  Its roots
are counted by Sturm's theorem and told apart by halving.

Source: S. Basu, R. Pollack, M.-F. Roy, Algorithms in Real Algebraic Geometry, section 2.2.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import NDArray

from oracles.first_meetings import BEHIND, MEETS, MISSES, tensor_net
from thbcad import FreeformSurface, KnotVector

WIDTH = Fraction(1, 1 << 40)  # mm, of the interval that holds a meeting

Polynomial = list[Fraction]  # of t, the constant first


class ExactGraph:
    """z = (x^2 + y^2) / 2R + spline."""

    def __init__(self, surface: FreeformSurface) -> None:
        knots, net = tensor_net(surface)
        self._axes = [_Axis(kv) for kv in knots]
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
        """Yield (low, high, f) between knot lines: of the first piece, and where the surface may be met."""
        lines = {first, last}
        for s, v, axis in zip(o, d, self._axes):
            if v:
                lines |= {t for t in ((b - s) / v for b in axis.breaks) if first < t < last}
        ends = sorted(lines)
        for low, high in pairwise(ends):
            middle = (low + high) / 2
            spans = [axis.span(s + middle * v) for axis, s, v in zip(self._axes, o, d)]
            if low == first or o[2] + high * d[2] >= self._lowest(spans):
                yield low, high, self._along(o, d, spans)

    def _lowest(self, spans: Sequence[int]) -> Fraction:
        """Return a height below the surface within a cell."""
        rows, columns = (slice(k - axis.degree, k + 1) for axis, k in zip(self._axes, spans))
        return min(min(row[columns]) for row in self._net[rows]) + self._least

    def _along(self, o: Sequence[Fraction], d: Sequence[Fraction], spans: Sequence[int]) -> Polynomial:
        """Return f within a cell.  spans : the knots at its left ends."""
        bases = [axis.basis(k, s, v) for axis, k, s, v in zip(self._axes, spans, o, d)]
        (x, y, z), (dx, dy, dz) = o, d
        f = [self._bend * (x * x + y * y) - z, 2 * self._bend * (x * dx + y * dy) - dz]
        f.append(self._bend * (dx * dx + dy * dy))
        first = [k - axis.degree for axis, k in zip(self._axes, spans)]
        for i, a in enumerate(bases[0]):
            row: Polynomial = []
            for j, b in enumerate(bases[1]):
                row = _sum(row, [self._net[first[0] + i][first[1] + j] * c for c in b])
            f = _sum(f, _product(a, row))
        return f


class _Axis:
    """Knots of one direction."""

    def __init__(self, kv: KnotVector) -> None:
        self.degree = kv.degree
        self.breaks = [Fraction(b) for b in kv.breaks.tolist()]
        self._knots = [Fraction(k) for k in kv.knots.tolist()]

    def span(self, x: Fraction) -> int:
        """Return the number of the last knot that is not above x."""
        return bisect_right(self._knots, x, self.degree + 1, len(self._knots) - self.degree - 1) - 1

    def basis(self, span: int, s: Fraction, v: Fraction) -> list[Polynomial]:
        """Return the B-splines that act on a span as polynomials of t, at s + v t: Cox and de Boor."""
        rows: list[Polynomial] = [[Fraction(1)]]
        for k in range(1, self.degree + 1):
            after: list[Polynomial] = [[] for _ in range(k + 1)]
            for r, b in enumerate(rows):
                left, right = self._knots[span - k + 1 + r], self._knots[span + 1 + r]
                rising = [(s - left) / (right - left), v / (right - left)]
                falling = [1 - rising[0], -rising[1]]
                after[r], after[r + 1] = _sum(after[r], _product(falling, b)), _product(rising, b)
            rows = after
        return rows


def _first_root(f: Polynomial, low: Fraction, high: Fraction) -> tuple[Fraction, Fraction] | None:
    """Return an interval that holds the first root of f in (low, high], where f falls below zero there.

    None stands for no root, or for one at which f does not change its sign.
    """
    if all(c > 0 for c in _bernstein(f, low, high)):
        return None
    chain = _sturm(f)
    roots = _roots(chain, low, high)
    while roots > 1:
        middle = (low + high) / 2
        before = _roots(chain, low, middle)
        low, high, roots = (low, middle, before) if before else (middle, high, roots)
    if not roots or _value(f, high) > 0:
        return None
    while high - low > WIDTH:
        middle = (low + high) / 2
        low, high = (middle, high) if _value(f, middle) > 0 else (low, middle)
    return low, high


def _bernstein(f: Polynomial, low: Fraction, high: Fraction) -> list[Fraction]:
    """Return the Bernstein coefficients of f on [low, high], between which it lies."""
    degree, local = len(f) - 1, [Fraction(0)]
    for c in reversed(f):  # f(low + (high - low) s) as a polynomial of s, by Horner's scheme
        local = _sum([c], _product(local, [low, high - low]))
    weights = [[Fraction(comb(k, j), comb(degree, j)) for j in range(k + 1)] for k in range(degree + 1)]
    return [sum((w * c for w, c in zip(row, local)), Fraction(0)) for row in weights]


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
