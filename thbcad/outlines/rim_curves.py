"""Smooth curves that no spline holds, as splines within 1e-9 mm: the rim above an arc, level lines of ruled
edges.  The rim above a line is a spline itself.

The curves have a known number of derivatives where they cross knot lines.  With knots of the same smoothness
there, interpolation at the Greville points converges with order 6 on the pieces.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.interpolate import make_interp_spline

from thbcad.checks import Floats, Integers
from thbcad.outlines.pieces import RimPiece
from thbcad.splines import BSplineSurface, KnotVector

DEGREE = 5
TOLERANCE = 1e-9  # mm
MOST_DEGREE = 10  # of an exact rim
NEAR = 1e-8  # rad, or of a straight side; nearer crossings count as one: CAD kernels drop spans below 1e-9
SAMPLES = np.arange(1, 16, 2) / 16
MOST_SPANS = 100_000


def fitted_curve(
    curve: Callable[[Floats], Floats], breaks: Floats, counts: Integers
) -> tuple[KnotVector, Floats]:
    """Return knots and poles (n, d) of a spline of degree 5 that stays within 1e-9 of a curve at eight points
    in every span.

    curve : function of t, (n,), that returns (n, d)
    breaks : (m,) float, increasing, where derivatives may jump
    counts : (m,) int, how often each inner break must be a knot

    Spans are bisected until the curve is met.

    Raises ValueError : a curve that needs more than 100,000 spans.
    """
    while len(breaks) <= MOST_SPANS:
        kv = KnotVector(DEGREE, np.repeat(breaks, np.r_[DEGREE + 1, counts[1:-1], DEGREE + 1]))
        t = kv.greville()
        spline = make_interp_spline(t, curve(t), DEGREE, t=kv.knots)
        samples = (breaks[:-1, None] + np.diff(breaks)[:, None] * SAMPLES).ravel()
        errors = np.linalg.norm(spline(samples) - curve(samples), axis=1).reshape(-1, len(SAMPLES))
        failing = errors.max(axis=1) > TOLERANCE
        if not failing.any():
            return kv, spline.c
        middles = breaks[:-1][failing] + np.diff(breaks)[failing] / 2
        order = np.argsort(np.r_[breaks, middles])
        breaks = np.r_[breaks, middles][order]
        counts = np.r_[counts, np.ones(len(middles), dtype=np.int64)][order]
    raise ValueError(f"the curve needs more than {MOST_SPANS} spans for {TOLERANCE:g} mm")


def rim_curve(graph: BSplineSurface, piece: RimPiece) -> tuple[KnotVector, Floats]:
    """Return knots and poles (x, y, z), (n, 3), of a graph above a piece of an outline, over its parameter,
    mm.

    Above a line along x or y the curve has the graph's degree p or q there, above others p + q, and is exact
    but for rounding; of a degree above 10, which CAD files do not hold, and above an arc it is as
    `fitted_curve`.

    Raises ValueError : as `fitted_curve`.
    """
    return matched_rims((graph,), (piece,))


def matched_rims(graphs: Sequence[BSplineSurface], pieces: Sequence[RimPiece]) -> tuple[KnotVector, Floats]:
    """Return knots and poles (x_0, y_0, z_0, x_1, ...), (n, 3 k), of k graphs, each above its own piece, as
    `rim_curve`; the pieces have equal ends."""

    def rim(t: Floats) -> Floats:
        rows = []
        for graph, piece in zip(graphs, pieces):
            x, y = graph.on_domain(*piece(t))
            rows += [x, y, graph(x, y)]
        return np.column_stack(rows)

    own = max(piece.degree(g.kv_u.degree, g.kv_v.degree) for g, piece in zip(graphs, pieces))
    exact = own <= MOST_DEGREE
    degree = int(own) if exact else DEGREE
    places, counts = [], []
    for graph, piece in zip(graphs, pieces):
        (lines_x, counts_x), (lines_y, counts_y) = (kinks(kv, degree) for kv in (graph.kv_u, graph.kv_v))
        at, line = piece.crossings(lines_x, lines_y)
        places.append(at)
        counts.append(np.concatenate([counts_x, counts_y])[line])
    breaks, needed = merged_breaks(np.concatenate(places), np.concatenate(counts), *pieces[0].ends)
    if not exact:
        return fitted_curve(rim, breaks, needed)
    kv = KnotVector(degree, np.repeat(breaks, np.r_[degree + 1, needed[1:-1], degree + 1]))
    return kv, make_interp_spline(kv.greville(), rim(kv.greville()), degree, t=kv.knots).c


def kinks(kv: KnotVector, degree: int = DEGREE) -> tuple[Floats, Integers]:
    """Return the inner breaks of a knot vector and how often a curve of a degree needs each as a knot.

    On a knot of multiplicity m a spline has p - m continuous derivatives.
    """
    values, repeats = np.unique(kv.knots[kv.degree + 1 : -kv.degree - 1], return_counts=True)
    return values, np.clip(degree - kv.degree + repeats, 1, degree)


def merged_breaks(places: Floats, counts: Integers, start: float, stop: float) -> tuple[Floats, Integers]:
    """Return the places between start and stop in their order, those that are near each other as one with the
    greater count, between both ends."""
    chosen = (places > start + NEAR) & (places < stop - NEAR)
    order = np.argsort(places[chosen])
    places = places[chosen][order]
    counts = counts[chosen][order]
    first = np.flatnonzero(np.diff(places, prepend=-1.0) > NEAR)
    merged = np.maximum.reduceat(counts, first) if len(first) else counts
    return np.r_[start, places[first], stop], np.r_[1, merged, 1]
