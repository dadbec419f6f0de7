"""The outline of a graph that is seen along an axis, whole or over the outline of a cut lens: its least
heights, with a proven error.

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

Of a cut lens: on a strip the heights are g(s, t) = z(u, v), with u from one end of an interval to the other
as s goes from 0 to 1.  With bounds of the derivatives of z and of u and v along t,

    |g_tt| <= M = |z_uu| u'^2 + 2 |z_uv| u' v' + |z_vv| v'^2 + |z_u| u'' + |z_v| v''.

The least heights then follow as above, with the minimisers s; on a line of sight they are the least
of points d apart, at most |z_uu| d^2 / 8 too great.  Chords over t add |v''| h^2 / 8 in v.

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 14 (convex hull property).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from thbcad.certified import cell_bounds
from thbcad.checks import Floats, Integers
from thbcad.drawings.cut_outlines import Strip
from thbcad.lens import subdivided
from thbcad.splines import BSplineSurface, halves

MOST_LINES = 200_000
BLOCK = 2**20  # Bernstein coefficients at a time
MOST_HALVINGS = 40  # then a piece of a line is as small as the spacing of its parameters
MOST_HEIGHTS = 20_000_000  # of a silhouette, some seconds
Line = tuple[Floats, float]  # points (v, z), (n, 2), and the bound of their error


def lowest_outline(graph: BSplineSurface, chord: float) -> tuple[Floats, Floats, float]:
    """Return parameters v (n,), the heights (n,) of the outline min over u of g(u, v) there, and the error in
    z of its chords, at most `chord`."""
    bend = cell_bounds(graph, ((0, 2),))[0].max(axis=0)
    slack = chord / 8  # of the values on the lines
    parts = np.ceil(np.diff(graph.kv_v.breaks) * np.sqrt(bend / (4 * chord)))
    require_few(parts.sum(), chord)
    return _within(
        chord,
        subdivided(graph.kv_v.breaks, np.maximum(parts, 1).astype(np.int64)),
        lambda lines: lowest_points(graph, lines, slack),
        lambda *rows: slack + _chord_errors(graph, bend, *rows),
    )


def _within(
    chord: float,
    lines: Floats,
    least: Callable[[Floats], tuple[Any, ...]],
    errors: Callable[..., Floats],
) -> tuple[Floats, Floats, float]:
    """Return lines, the least heights on them, and the greatest error of the chords between: intervals are
    halved until none is greater than `chord`.

    least : from lines to the least heights there, and where they are
    errors : from lines and what `least` returns to the errors of the intervals
    """
    rows: tuple[Any, ...] = (lines, *least(lines))
    while True:
        error = errors(*rows)
        failing = error > chord
        if not failing.any():
            return rows[0], rows[1], float(error.max())
        middles = (rows[0][:-1] + np.diff(rows[0]) / 2)[failing]
        require_few(len(rows[0]) + len(middles), chord)
        where = np.flatnonzero(failing) + 1
        pairs = zip(rows, (middles, *least(middles)))
        rows = tuple(np.insert(row, where, new) for row, new in pairs)


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


@dataclass(frozen=True, eq=False)
class GraphOverStrips:
    """A graph z(u, v) over the strips of an outline, to be drawn within a chord error, mm."""

    graph: BSplineSurface
    strips: Sequence[Strip]
    chord: float

    @cached_property
    def _bounds(self) -> Floats:
        """Bounds of |z_uu|, |z_uv|, |z_vv|, |z_u| and |z_v|."""
        bounds: Floats = cell_bounds(self.graph, ((2, 0), (1, 1), (0, 2), (1, 0), (0, 1))).max(axis=(1, 2))
        return bounds

    def lowest(self) -> Line:
        """Return the least heights over v."""
        return _joined([self._lowest(strip) for strip in self.strips])

    def side(self, number: int, end: int) -> list[Line]:
        """Return the heights above one end (0, 1) of the interval with a number, in all strips that have it,
        joined where strips follow each other."""
        runs: list[list[Line]] = [[]]
        for strip in self.strips:
            if strip.at(np.array(strip.ends[:1]))[1].shape[1] <= number:
                runs.append([])
                continue
            t = self._lines(strip, self.chord / 2)
            chosen = np.full(len(t), number), np.full(len(t), float(end))
            v, z = self._heights(strip, t, *chosen)
            bound = (self._bend(strip) + strip.speeds[3]) * np.diff(t).max() ** 2 / 8
            runs[-1].append((np.column_stack([v, z]), float(bound)))
        return [_joined(run) for run in runs if run]

    def _bend(self, strip: Strip) -> float:
        uu, uv, vv, u, v = self._bounds
        u1, u2, v1, v2 = strip.speeds
        return float(uu * u1**2 + 2 * uv * u1 * v1 + vv * v1**2 + u * u2 + v * v2)

    def _lines(self, strip: Strip, chord: float) -> Floats:
        """Return parameters whose chords keep an error along a fixed s."""
        start, stop = strip.ends
        parts = (stop - start) * np.sqrt((self._bend(strip) + strip.speeds[3]) / (8 * chord))
        require_few(parts, self.chord)
        return np.linspace(start, stop, max(int(np.ceil(parts)), 1) + 1)

    def _lowest(self, strip: Strip) -> Line:
        t = self._lines(strip, self.chord / 2)
        least, errors = partial(self._least, strip), partial(self._chord_errors, strip)
        t, z, bound = _within(self.chord, t, least, errors)
        return np.column_stack([strip.at(t)[0], z]), bound

    def _chord_errors(self, strip: Strip, t: Floats, z: Floats, number: Integers, s: Floats) -> Floats:
        """Return slack + M h^2 / 8 + a b / (a + b) + |v''| h^2 / 8 of every interval."""
        a = np.maximum(self._heights(strip, t[1:], number[:-1], s[:-1])[1] - z[1:], 0.0)
        b = np.maximum(self._heights(strip, t[:-1], number[1:], s[1:])[1] - z[:-1], 0.0)
        crossing = np.divide(a * b, a + b, out=np.zeros_like(a), where=a + b > 0)
        bend = self._bend(strip) + strip.speeds[3]
        errors: Floats = self._slack + np.diff(t) ** 2 * bend / 8 + crossing
        return errors

    @property
    def _slack(self) -> float:
        """What the least heights on lines may be too great."""
        return self.chord / 8

    def _heights(self, strip: Strip, t: Floats, number: Integers, s: Floats) -> tuple[Floats, Floats]:
        """Return v and z at parameters, each with its interval and its place s there."""
        v, ends = strip.at(t)
        low, high = ends[np.arange(len(t)), number].T
        return v, self.graph(*self.graph.on_domain(low + s * (high - low), v))

    def _least(self, strip: Strip, t: Floats) -> tuple[Floats, Integers, Floats]:
        """Return the least heights on lines, the numbers of their intervals, and s."""
        v, ends = strip.at(t)
        width = float((ends[..., 1] - ends[..., 0]).max())
        count = width * np.sqrt(self._bounds[0] / (8 * self._slack))
        if count * ends.shape[1] * len(t) > MOST_HEIGHTS:
            raise ValueError(
                f"a chord error of {self.chord:.3g} mm needs more than {MOST_HEIGHTS:,} heights of a "
                "silhouette; allow a greater one"
            )
        s = np.linspace(0, 1, int(np.ceil(count)) + 2)
        step = max(1, BLOCK // (len(s) * ends.shape[1]))
        found = []
        for first in range(0, len(t), step):
            low, high = (ends[first : first + step, :, k, None] for k in (0, 1))
            u = low + s * (high - low)
            across = np.broadcast_to(v[first : first + step, None, None], u.shape)
            heights = self.graph(*self.graph.on_domain(u.ravel(), across.ravel())).reshape(len(u), -1)
            best = heights.argmin(axis=1)
            found.append((heights[np.arange(len(u)), best], best // len(s), s[best % len(s)]))
        z, number, at = (np.concatenate(rows) for rows in zip(*found))
        return z, number, at


def _joined(lines: Sequence[Line]) -> Line:
    """Return lines that follow each other as one; where heights jump, it is upright there."""
    points = np.concatenate([line for line, _ in lines])
    new = np.insert((np.diff(points, axis=0) != 0).any(axis=1), 0, True)
    return points[new], max(bound for _, bound in lines)
