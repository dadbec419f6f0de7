"""Where rays first fall through a graph, proven by intervals: the referee of searches for meeting points.

The graph is z = (x^2 + y^2) / 2R + spline.  Along a ray, f(t) = height of the surface - height of the ray is
a polynomial between two neighbouring knot lines.  Its Bernstein coefficients there enclose it:

    f_k = sum over i + j = k of C(p, i) C(q, j) / C(p + q, k) r_ij,

with the coefficients r_ij of the spline on the rectangle of which the piece of the ray is a diagonal.  Pieces
are halved until f is positive on them, or falls through zero once.  Every number is the middle of an
interval, whose radius bounds all roundings on the way to it; a sign counts where all of the interval has it.
`oracles.exact_meetings` decides what intervals leave open.

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 14; R. E. Moore, R. B. Kearfott, M. J. Cloud,
Introduction to Interval Analysis, chapters 2 and 5.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import comb

import numpy as np
from numpy.typing import NDArray

from thbcad import FreeformSurface, KnotVector

MISSES, MEETS, BEHIND, OPEN = range(4)  # BEHIND: the ray comes over the rectangle above the surface
AT_ONCE = 1 << 15  # rays
HALVINGS = 24  # of a piece, before the proof is left to exact numbers
NARROWINGS = 48  # of the interval in which f falls through zero
ROUNDINGS = 128  # of a coefficient of f, generously: 60 of the extraction and the two restrictions
EPS = 2.0**-53

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Meetings:
    """What rays do first, (n,) each.

    fate : MISSES, MEETS, BEHIND, or OPEN where intervals do not decide.
    low, high : mm along the ray, between which f falls through zero for the first time; NaN unless it MEETS.
    """

    fate: Integers
    low: Floats
    high: Floats


@dataclass(frozen=True, eq=False)
class Graph:
    """The surface as Bernstein coefficients: nets (n_x, n_y, p + 1, q + 1) on the cells between breaks."""

    breaks: tuple[Floats, Floats]
    nets: Floats
    bend: float

    @classmethod
    def of(cls, surface: FreeformSurface) -> Graph:
        knots, net = tensor_net(surface)
        a, b = (kv.bezier() for kv in knots)
        p, q = (kv.degree + 1 for kv in knots)
        cells = (a @ (b @ net.T).T).reshape(-1, p, b.shape[0] // q, q).transpose(0, 2, 1, 3)
        return cls((knots[0].breaks, knots[1].breaks), cells, 0.5 / surface.conic.radius)

    def radius(self, origin: Floats, direction: Floats, last: Floats) -> Floats:
        """Return bounds of the rounding errors of f and its coefficients along rays, (n,)."""
        widths = [np.diff(b).min() for b in self.breaks]
        size = np.abs(origin).max(axis=0) + last + max(b[-1] for b in self.breaks)
        steps = [np.abs(np.diff(self.nets, axis=k)).max() for k in (2, 3)]
        slope = sum((self.nets.shape[k] - 1) * s / w for k, s, w in zip((2, 3), steps, widths))
        slope += 4 * abs(self.bend) * size + 1
        return ROUNDINGS * EPS * (np.abs(self.nets).max() + slope * size)

    def heights(self) -> tuple[Floats, Floats]:
        """Return the least and the greatest height on every cell, as its coefficients bound them."""
        near, far = [], []
        for b in self.breaks:
            ends = np.abs([b[:-1], b[1:]])
            near.append(np.where(b[:-1] * b[1:] < 0, 0.0, ends.min(axis=0) ** 2))
            far.append(ends.max(axis=0) ** 2)
        conic = [self.bend * (x[:, None] + y[None, :]) for x, y in (near, far)]
        low, high = self.nets.min(axis=(2, 3)), self.nets.max(axis=(2, 3))
        return low + np.min(conic, axis=0), high + np.max(conic, axis=0)


def tensor_net(surface: FreeformSurface) -> tuple[tuple[KnotVector, KnotVector], Floats]:
    """Return the knots, mm, and the coefficients of a sag's tensor-product form.

    Raises ValueError : no sag, or a conic that is neither a plane nor a paraboloid.
    """
    if surface.sag is None or not (surface.conic.is_plane or surface.conic.constant == -1):
        raise ValueError("the referee knows splines on planes and paraboloids")
    embedding = surface.sag.space.embedding
    kv_x, kv_y = (kv.rescale(-h, h) for kv, h in zip((embedding.kv_u, embedding.kv_v), surface.half_width))
    return (kv_x, kv_y), embedding.coefficients(surface.sag.coefficients)


def first_meetings(surface: FreeformSurface, origin: Floats, direction: Floats) -> Meetings:
    """Return the first Meetings of rays, (3, n) each, that rise towards +z."""
    graph, found = Graph.of(surface), []
    for start in range(0, origin.shape[1], AT_ONCE):
        part = slice(start, start + AT_ONCE)
        found.append(_first_meetings(graph, origin[:, part], direction[:, part]))
    return Meetings(*(np.concatenate(column) for column in zip(*found)))


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Pieces of rays between two path lengths.  f : its Bernstein coefficients, (n, p + q + 1)."""

    ray: Integers
    low: Floats
    high: Floats
    f: Floats
    radius: Floats

    def __getitem__(self, chosen: NDArray[np.bool_]) -> _Pieces:
        return _Pieces(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def __add__(self, other: _Pieces) -> _Pieces:
        pairs = ((getattr(self, field.name), getattr(other, field.name)) for field in fields(self))
        return _Pieces(*(np.concatenate(pair) for pair in pairs))

    def halves(self) -> tuple[_Pieces, _Pieces]:
        """Return the first and the second halves, by de Casteljau's algorithm."""
        left, right, f = [], [], self.f
        while f.shape[1]:
            left.append(f[:, 0])
            right.append(f[:, -1])
            f = (f[:, :-1] + f[:, 1:]) / 2
        middle = self.low + (self.high - self.low) / 2
        return (
            _Pieces(self.ray, self.low, middle, np.stack(left, axis=1), self.radius),
            _Pieces(self.ray, middle, self.high, np.stack(right[::-1], axis=1), self.radius),
        )

    def falls(self) -> NDArray[np.bool_]:
        """Return where f falls all the way, from above zero to below."""
        steps = np.diff(self.f, axis=1) < -2 * self.radius[:, None]
        return steps.all(axis=1) & (self.f[:, 0] > self.radius) & (self.f[:, -1] < -self.radius)


def _first_meetings(graph: Graph, origin: Floats, direction: Floats) -> tuple[Integers, Floats, Floats]:
    first, last = _span(graph, origin, direction)
    fate = np.full(len(first), MISSES)
    pieces = _pieces(graph, origin, direction, first, last)
    begins = pieces.low == first[pieces.ray]
    fate[pieces.ray[begins & (pieces.f[:, 0] <= pieces.radius)]] = OPEN
    fate[pieces.ray[begins & (pieces.f[:, 0] < -pieces.radius)]] = BEHIND
    pieces = pieces[fate[pieces.ray] == MISSES]
    best, falling = np.full(len(first), np.inf), []
    for halvings in range(HALVINGS + 1):
        falls = pieces.falls()
        falling.append(pieces[falls])
        np.minimum.at(best, pieces.ray[falls], pieces.low[falls])
        # the first piece that ends below zero holds the first meeting, or one before it does
        sunk, ends = pieces.f[:, -1] < -pieces.radius, np.full(len(first), np.inf)
        np.minimum.at(ends, pieces.ray[sunk], pieces.high[sunk])
        positive = (pieces.f > pieces.radius[:, None]).all(axis=1)
        ahead = (pieces.low < best[pieces.ray]) & (pieces.high <= ends[pieces.ray])
        pieces = pieces[~falls & ~positive & ahead]
        if halvings == HALVINGS or not len(pieces.ray):
            break
        left, right = pieces.halves()
        pieces = left + right
    fate[np.isfinite(best)] = MEETS
    fate[pieces.ray[pieces.low < best[pieces.ray]]] = OPEN
    low, high = np.full(len(first), np.nan), np.full(len(first), np.nan)
    for found in falling:
        chosen = (found.low == best[found.ray]) & (fate[found.ray] == MEETS)
        narrow = _narrowed(found[chosen])
        low[narrow.ray], high[narrow.ray] = narrow.low, narrow.high
    return fate, low, high


def _span(graph: Graph, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Return the path lengths between which rays are over the rectangle and below the highest point."""
    last = (graph.heights()[1].max() + graph.breaks[0][-1] - origin[2]) / direction[2]
    first = np.zeros_like(last)
    for s, d, breaks in zip(origin, direction, graph.breaks):
        moves = d != 0
        ends = np.sort((breaks[[0, -1], None] - s) / np.where(moves, d, 1.0), axis=0)
        inside = (s >= breaks[0]) & (s <= breaks[-1])
        first = np.where(moves, np.maximum(first, ends[0]), np.where(inside, first, np.inf))
        last = np.where(moves, np.minimum(last, ends[1]), last)
    return first, last


def _pieces(graph: Graph, origin: Floats, direction: Floats, first: Floats, last: Floats) -> _Pieces:
    """Return the pieces of rays between knot lines that may hold a meeting, and every ray's first piece."""
    lines = [first[:, None], last[:, None]]
    for s, d, breaks in zip(origin, direction, graph.breaks):
        moves = (d != 0)[:, None]
        at = (breaks[1:-1] - s[:, None]) / np.where(moves, d[:, None], 1.0)
        lines.append(np.where(moves, at, first[:, None]))
    t = np.sort(np.clip(np.concatenate(lines, axis=1), first[:, None], last[:, None]), axis=1)
    t[~(first < last)] = 0.0
    ray, k = np.nonzero(t[:, 1:] > t[:, :-1])
    low, high = t[ray, k], t[ray, k + 1]
    i, j = (
        np.clip(np.searchsorted(b, s[ray] + (low + high) / 2 * d[ray]) - 1, 0, len(b) - 2)
        for s, d, b in zip(origin, direction, graph.breaks)
    )
    radius = graph.radius(origin, direction, np.where(first < last, last, 0.0))[ray]
    lowest, highest = (h[i, j] for h in graph.heights())
    enters, leaves = (origin[2][ray] + s * direction[2][ray] for s in (low, high))
    # behind a cell that the ray crosses above the surface no meeting is the first
    passed, above = np.full(len(first), np.inf), enters > highest + radius
    np.minimum.at(passed, ray[above], low[above])
    chosen = (low == first[ray]) | ((leaves >= lowest - radius) & (low < passed[ray]))
    ray, low, high, i, j = (a[chosen] for a in (ray, low, high, i, j))
    f = _along(graph, (i, j), origin[:, ray], direction[:, ray], (low, high))
    return _Pieces(ray, low, high, f, radius[chosen])


def _along(
    graph: Graph,
    cell: tuple[Integers, Integers],
    origin: Floats,
    direction: Floats,
    ends: tuple[Floats, Floats],
) -> Floats:
    """Return the Bernstein coefficients of f, (n, p + q + 1), on pieces of rays within cells."""
    net = np.moveaxis(graph.nets[cell], 0, -1)  # (p + 1, q + 1, n)
    for axis, breaks in enumerate(graph.breaks):
        left, width = breaks[:-1][cell[axis]], np.diff(breaks)[cell[axis]]
        local = [(origin[axis] - left + t * direction[axis]) / width for t in ends]
        net = np.swapaxes(_restricted(np.swapaxes(net, 0, axis), *local), 0, axis)
    p, q = net.shape[0] - 1, net.shape[1] - 1
    degree = p + q
    f = np.zeros((degree + 1, net.shape[2]))
    for i in range(p + 1):
        for j in range(q + 1):
            f[i + j] += comb(p, i) * comb(q, j) / comb(degree, i + j) * net[i, j]
    (x0, y0, z0), (x1, y1, z1) = (origin + t * direction for t in ends)
    squares = x0 * x0 + y0 * y0, x0 * x1 + y0 * y1, x1 * x1 + y1 * y1
    for k in range(degree + 1):
        weights = (degree - k) * (degree - k - 1), 2 * k * (degree - k), k * (k - 1)
        square = sum(w * s for w, s in zip(weights, squares)) / (degree * (degree - 1))
        f[k] += graph.bend * square - z0 - k / degree * (z1 - z0)
    return f.T


def _restricted(net: Floats, start: Floats, stop: Floats) -> Floats:
    """Return Bernstein coefficients (p + 1, ..., n) on the intervals from start to stop: polar forms."""
    p, out = net.shape[0] - 1, []
    for k in range(p + 1):
        c = net
        for u in [stop] * k + [start] * (p - k):
            c = c[:-1] + u * (c[1:] - c[:-1])
        out.append(c[0])
    return np.stack(out)


def _narrowed(pieces: _Pieces) -> _Pieces:
    """Return pieces on which f falls through zero, halved until the sign at the middle is not sure."""
    for _ in range(NARROWINGS):
        left, right = pieces.halves()
        above, below = (sign * left.f[:, -1] > pieces.radius for sign in (1, -1))
        pieces = _Pieces(
            pieces.ray,
            np.where(above, right.low, pieces.low),
            np.where(below, left.high, pieces.high),
            np.where(above[:, None], right.f, np.where(below[:, None], left.f, pieces.f)),
            pieces.radius,
        )
    return pieces
