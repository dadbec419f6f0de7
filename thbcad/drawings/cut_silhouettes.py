"""Silhouettes of a graph over the outline of a cut lens, with a proven error.

On a strip the heights are g(s, t) = z(u, v), with u from one end of an interval to the other as s goes from 0
to 1.  With bounds of the derivatives of z and of u and v along t,

    |g_tt| <= M = |z_uu| u'^2 + 2 |z_uv| u' v' + |z_vv| v'^2 + |z_u| u'' + |z_v| v''.

The least heights then follow as in `envelopes`, with the minimisers s; on a line of sight they are the least
of points d apart, at most |z_uu| d^2 / 8 too great.  Chords over t add |v''| h^2 / 8 in v.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thbcad.certified import cell_bounds
from thbcad.checks import Floats, Integers
from thbcad.drawings.cut_outlines import Strip
from thbcad.drawings.envelopes import require_few
from thbcad.splines import BSplineSurface

BLOCK = 2**20  # points at a time
MOST_HEIGHTS = 20_000_000  # of a silhouette, some seconds

Line = tuple[Floats, float]  # points (v, z), (n, 2), and the bound of their error


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
        z, number, s = self._least(strip, t)
        while True:
            errors = self._chord_errors(strip, t, z, number, s)
            failing = errors > self.chord
            if not failing.any():
                return np.column_stack([strip.at(t)[0], z]), float(errors.max())
            middles = (t[:-1] + np.diff(t) / 2)[failing]
            require_few(len(t) + len(middles), self.chord)
            where = np.flatnonzero(failing) + 1
            rows = zip((t, z, number, s), (middles, *self._least(strip, middles)))
            t, z, number, s = (np.insert(row, where, new) for row, new in rows)

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
        return v, self._evaluated(low + s * (high - low), v)

    def _evaluated(self, u: Floats, v: Floats) -> Floats:
        """Return the graph at points, those that rounding put beside it moved onto its rim."""
        u, v = (
            np.clip(row, kv.start, kv.stop) for row, kv in zip((u, v), (self.graph.kv_u, self.graph.kv_v))
        )
        heights: Floats = self.graph(u, v)
        return heights

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
            heights = self._evaluated(u.ravel(), across.ravel()).reshape(len(u), -1)
            best = heights.argmin(axis=1)
            found.append((heights[np.arange(len(u)), best], best // len(s), s[best % len(s)]))
        z, number, at = (np.concatenate(rows) for rows in zip(*found))
        return z, number, at


def _joined(lines: Sequence[Line]) -> Line:
    """Return lines that follow each other as one; where heights jump, it is upright there."""
    points = np.concatenate([line for line, _ in lines])
    new = np.insert((np.diff(points, axis=0) != 0).any(axis=1), 0, True)
    return points[new], max(bound for _, bound in lines)
