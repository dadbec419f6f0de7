"""The outline of a graph that is seen along an axis: its least heights, with a proven error.

For a spline g(u, v) the outline against the parameter v is e(v) = min over u of g(u, v).  Between the lines
v_0 and v_1, h apart, with a bound M of |g_vv|, e is a minimum of functions whose second derivative is at most
M, hence

    e(v) >= chord of e - M h^2 / 8,

and e(v) <= g(u_k, v) for the minimisers u_0 and u_1 of both lines, which lie within M h^2 / 8 of their own
chords.  With a = g(u_0, v_1) - e(v_1) and b = g(u_1, v_0) - e(v_0) these two chords cross a b / (a + b) above
the chord of e:

    |e(v) - chord of e| <= M h^2 / 8 + a b / (a + b).

It holds across kinks too, where the minimiser jumps.  Intervals are halved until it is small enough.  On a
line the minimum is found by branch and bound on Bernstein coefficients.

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 14 (convex hull property).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thbcad.certified import cell_bounds
from thbcad.checks import Floats, Integers
from thbcad.lens import subdivided
from thbcad.splines import BSplineSurface, halves

MOST_LINES = 200_000
BLOCK = 2**20  # Bernstein coefficients at a time
MOST_HALVINGS = 40  # then a piece of a line is as small as the spacing of its parameters


@dataclass(frozen=True, eq=False)
class Outline:
    """Heights z (n,) of an outline at increasing parameters v (n,), joined by chords.

    bound : float, nowhere are the chords farther in z from the exact outline.
    """

    v: Floats
    z: Floats
    bound: float


def lowest_outline(graph: BSplineSurface, chord: float) -> Outline:
    """Return the Outline min over u of g(u, v), its chords at most `chord` from the exact one.

    Raises
    ------
    ValueError : more than 200,000 chords.
    """
    bend = cell_bounds(graph, ((0, 2),))[0].max(axis=0)
    slack = chord / 8  # of the values on the lines
    parts = np.ceil(np.diff(graph.kv_v.breaks) * np.sqrt(bend / (4 * chord)))
    require_few(parts.sum(), chord)
    v = subdivided(graph.kv_v.breaks, np.maximum(parts, 1).astype(np.int64))
    z, u = lowest_points(graph, v, slack)
    while True:
        error = slack + _chord_errors(graph, bend, v, z, u)
        failing = error > chord
        if not failing.any():
            return Outline(v, z, float(error.max()))
        middles = (v[:-1] + np.diff(v) / 2)[failing]
        require_few(len(v) + len(middles), chord)
        between, at = lowest_points(graph, middles, slack)
        where = np.flatnonzero(failing) + 1
        v, z, u = (np.insert(row, where, new) for row, new in ((v, middles), (z, between), (u, at)))


def require_few(lines: float, chord: float) -> None:
    if lines > MOST_LINES:
        raise ValueError(
            f"a chord error of {chord:g} mm needs more than {MOST_LINES:,} lines of an outline; "
            "allow a greater one"
        )


def _chord_errors(graph: BSplineSurface, bend: Floats, v: Floats, z: Floats, u: Floats) -> Floats:
    """Return M h^2 / 8 + a b / (a + b) of every interval between lines."""
    cell = np.searchsorted(graph.kv_v.breaks, v[:-1], "right") - 1
    a = np.maximum(graph(u[:-1], v[1:]) - z[1:], 0.0)
    b = np.maximum(graph(u[1:], v[:-1]) - z[:-1], 0.0)
    crossing = np.divide(a * b, a + b, out=np.zeros_like(a), where=a + b > 0)
    errors: Floats = np.diff(v) ** 2 * bend[cell] / 8 + crossing
    return errors


def lowest_points(graph: BSplineSurface, v: Floats, slack: float) -> tuple[Floats, Floats]:
    """Return (values, u): the least value of a scalar spline on every line v, at most `slack` too great.

    v : (n,) float.  Returns (n,) float each.
    """
    step = max(1, BLOCK // (graph.kv_u.spans * (graph.kv_u.degree + 1)))
    blocks = [_lowest(graph, v[first : first + step], slack) for first in range(0, len(v), step)]
    values, u = (np.concatenate(rows) for rows in zip(*blocks))
    return values, u


def _lowest(graph: BSplineSurface, v: Floats, slack: float) -> tuple[Floats, Floats]:
    kv = graph.kv_u
    lines = graph.kv_v.collocation(v) @ graph.coefficients.T
    nets = (kv.bezier() @ lines.T).reshape(kv.spans, kv.degree + 1, len(v))
    nets = nets.transpose(2, 0, 1).reshape(-1, kv.degree + 1)
    owner = np.repeat(np.arange(len(v)), kv.spans)
    ends = np.tile(np.stack([kv.breaks[:-1], kv.breaks[1:]], axis=1), (len(v), 1))
    best = np.full(len(v), np.inf)
    at = np.full(len(v), kv.start)
    both = halves(kv.degree)
    for _ in range(MOST_HALVINGS):
        for end in (0, -1):
            _lower(best, at, owner, nets[:, end], ends[:, end])
        open_ = nets.min(axis=1) < best[owner] - slack
        if not open_.any():
            break
        middle = ends[open_].mean(axis=1)
        low, high = ends[open_].copy(), ends[open_].copy()
        low[:, 1] = high[:, 0] = middle
        nets = np.concatenate([nets[open_] @ half.T for half in both])
        ends = np.concatenate([low, high])
        owner = np.tile(owner[open_], 2)
    return best, at


def _lower(best: Floats, at: Floats, owner: Integers, values: Floats, u: Floats) -> None:
    """Lower the best value of every line, and set where it is, where one of its values is less."""
    order = np.lexsort((values, owner))
    lines, first = np.unique(owner[order], return_index=True)
    chosen = order[first]
    less = values[chosen] < best[lines]
    best[lines[less]] = values[chosen[less]]
    at[lines[less]] = u[chosen[less]]
