"""Straight and elliptic pieces of a curve round a lens, and what a spline graph holds within such a curve.

A piece is a function (x, y) of t between its ends.  Between two crossings of knot lines a spline graph
z(x, y) of degrees (p, q) is a polynomial of degree p + q in t above a line, and a trigonometric polynomial of
that degree above an arc.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats, Integers
from thbcad.splines import BSplineSurface, Primitive, gauss_rule

LEAST_SIZE = 1e-6  # mm; CAD kernels take points within 1e-7 mm for one
QUARTERS = np.pi / 2 * np.arange(5)
Pair = tuple[float, float]


@dataclass(frozen=True)
class Line:
    """(x, y) = start + t (stop - start), 0 <= t <= 1, mm."""

    start: Pair
    stop: Pair

    ends = (0.0, 1.0)

    def __call__(self, t: ArrayLike, derivative: int = 0) -> tuple[Floats, Floats]:
        """Return (x, y), or its first derivative, at parameters t, (n,) each."""
        start, t = np.array(self.start), np.asarray(t, dtype=np.float64)
        step = self.stop - start
        x, y = np.outer(t**0, step).T if derivative else (start + t[:, None] * step).T
        return x, y

    def crossings(self, x: Floats, y: Floats) -> tuple[Floats, Integers]:
        """Return where within it the line crosses the lines x = x_i and y = y_j.

        Returns (places, lines): (n,) float and (n,) int, lines i of x and len(x) + j of y; not sorted.
        """
        places = []
        lines = []
        first = 0
        for row, origin, step in zip((x, y), self.start, np.subtract(self.stop, self.start)):
            place = (row - origin) / step if step else np.full(len(row), np.inf)
            hit = np.flatnonzero((place > 0) & (place < 1))
            places.append(place[hit])
            lines.append(first + hit)
            first += len(row)
        return np.concatenate(places), np.concatenate(lines)

    def rule(self, x: Floats, y: Floats, degree: int) -> tuple[Floats, Floats]:
        """Return nodes and weights of Gauss rules that are exact for polynomials of degree + 1 between the
        crossings with lines."""
        places, _ = self.crossings(x, y)
        return gauss_rule(np.unique(np.r_[0.0, places, 1.0]), (degree + 1) // 2 + 1)

    def degree(self, p: int, q: int) -> float:
        """Return the degree in t of a graph of degrees (p, q) above the line."""
        return sum(d for d, a, b in zip((p, q), self.start, self.stop) if a != b)

    def scaled(self, factors: ArrayLike) -> Line:
        """Return the line with x and y multiplied by two factors."""
        start, stop = (np.multiply(end, factors) for end in (self.start, self.stop))
        return Line((float(start[0]), float(start[1])), (float(stop[0]), float(stop[1])))


@dataclass(frozen=True)
class Arc:
    """The piece of an ellipse with semi-axes (a, b) round a centre (x, y), mm, between two angles t, counted
    counter-clockwise from the x axis, or from the y axis where it is upright:

        (x, y) = centre + (a cos t, b sin t),  or  centre + (-a sin t, b cos t).

    CAD kernels count from the longer semi-axis.
    """

    semi_axes: Pair
    ends: Pair
    upright: bool
    centre: Pair = (0.0, 0.0)

    @property
    def is_round(self) -> bool:
        """Whether it is a piece of a circle."""
        return self.semi_axes[0] == self.semi_axes[1]

    def __call__(self, t: ArrayLike, derivative: int = 0) -> tuple[Floats, Floats]:
        """Return (x, y), or its first derivative, at angles t, (n,) each."""
        (a, b), t = self.semi_axes, np.asarray(t, dtype=np.float64) + derivative * np.pi / 2
        x, y = (-a * np.sin(t), b * np.cos(t)) if self.upright else (a * np.cos(t), b * np.sin(t))
        return (x, y) if derivative else (self.centre[0] + x, self.centre[1] + y)

    def crossings(self, x: Floats, y: Floats) -> tuple[Floats, Integers]:
        """Return the angles between its ends at which the arc crosses the lines x = x_i and y = y_j, as
        `Line.crossings` does; of a closed one also that of its first end."""
        angles = []
        lines = []
        start = 0
        for d, row in enumerate((x, y)):
            relative = (row - self.centre[d]) / self.semi_axes[d]
            hit = np.flatnonzero(abs(relative) <= 1)
            # angles from the axis d, then from the axis where t = 0
            turn = (np.pi / 2 if d == 1 else 0.0) - (np.pi / 2 if self.upright else 0.0)
            for sign in (1, -1):
                angles.append((turn + sign * np.arccos(relative[hit])) % (2 * np.pi))
                lines.append(start + hit)
            start += len(row)
        places, numbers = np.concatenate(angles), np.concatenate(lines)
        within = (places >= self.ends[0]) & (places <= self.ends[1])
        return places[within], numbers[within]

    def rule(self, x: Floats, y: Floats, degree: int) -> tuple[Floats, Floats]:
        """Return nodes and weights of Gauss rules between the crossings with lines.

        With degree + 8 nodes on pieces of at most a quarter turn they err by less than 1e-14 of the size of
        each harmonic, of which the last is number degree + 2.

        Source: P. Davis, P. Rabinowitz, Methods of Numerical Integration, 2.7 (remainder of the Gauss rule).
        """
        places, _ = self.crossings(x, y)
        quarters = QUARTERS[(self.ends[0] < QUARTERS) & (self.ends[1] > QUARTERS)]
        return gauss_rule(np.unique(np.r_[self.ends, quarters, places]), degree + 8)

    def degree(self, p: int, q: int) -> float:
        """Return inf: no polynomial describes a graph above an arc."""
        return np.inf

    def scaled(self, factors: ArrayLike) -> Arc:
        """Return the arc with x and y multiplied by two factors, over the same angles."""
        (a, b), (x, y) = np.multiply([self.semi_axes, self.centre], factors).tolist()
        return Arc((a, b), self.ends, self.upright, (x, y))


RimPiece = Line | Arc


class Path(Protocol):
    """A piece of a curve round a lens, whatever describes it."""

    @property
    def ends(self) -> Pair:
        """The first and the last parameter."""

    def __call__(self, t: ArrayLike, derivative: int = 0) -> tuple[Floats, Floats]:
        """Return (x, y), or its first derivative, at parameters t, (n,) each."""

    def rule(self, x: Floats, y: Floats, degree: int) -> tuple[Floats, Floats]:
        """Return nodes and weights of Gauss rules between the crossings with lines, as `Line.rule`."""


def integral_within(graph: BSplineSurface, pieces: Sequence[Path]) -> float:
    """Return the integral of a scalar spline z(x, y) within a curve of pieces, counter-clockwise, in its
    rectangle.

    By Green's theorem it is the closed integral of Z dy with dZ/dx = z; Gauss quadrature leaves rounding
    errors.
    """
    p, q = graph.kv_u.degree, graph.kv_v.degree
    lines = graph.kv_u.breaks, graph.kv_v.breaks
    primitive = Primitive(graph, *lines, (p // 2 + 1, q + 1))
    total = 0.0
    for piece in pieces:
        t, weights = piece.rule(*lines, p + q)
        total += float(weights @ (primitive(*graph.on_domain(*piece(t))) * piece(t, 1)[1]))
    return total
