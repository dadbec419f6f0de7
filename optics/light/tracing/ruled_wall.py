"""The wall of a lens whose corners are rounded, and where rays meet it: a cylinder, a cone, or any ruled one.

The wall consists of the straight rulings F(s) + w (R(s) - F(s)), 0 <= w <= 1, from the front's rim to the
rear's at equal relative positions.  A ray o + t d meets the line of a ruling where

    G(s) = d . ((R - F) x (o - F)) = 0,    and there    G'(s) = d . N,    N = (F' + w (R' - F')) x (R - F),

with N outward if s runs counter-clockwise: light comes out where G rises, and in where it falls.  In the plan
the ruling passes the ray's line between the line's meetings with the two outlines.  These have closed forms
and bound s, by two intervals; of a cylinder these are two points.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

from optics.base.runtime import DrArray
from optics.light.intersections import (
    DeviceRays,
    PlacedSurface,
    Vector,
    chord,
    first_crossing,
    last_root,
)
from optics.light.tracing.graph_face import Meeting
from thbcad.outlines import Outline

Pair = Sequence[DrArray]  # x and y, or start and stop

MARGIN = 1e-6  # of s: lines that touch an outline leave its ends open by 1e-8
ROOTS = 8  # of G in an interval at most
ON_CYLINDER = 2  # so many, of both points; a ray that is parallel to the rulings has no end of them
STEP = pi / 8  # of s, between samples at most
RESOLUTION = 2.0**-51  # of s


class RuledWall:
    """The wall between the rims of a front and a rear with rounded corners.

    s runs through a quarter of the relative outline, x / hx and y / hy, from the middle of a side to that of
    the next one: along the side, by the angle round the corner, along the other side.
    """

    def __init__(
        self, surfaces: Sequence[PlacedSurface], outlines: Sequence[Outline], near: float, reach: float
    ) -> None:
        """near : mm, so far behind its start a ray meets the wall.  reach : mm, of rulings over rims."""
        self.backend = backend = surfaces[0].backend
        self._surfaces, self._outlines = surfaces, outlines
        opaque, corners = backend.opaque, outlines[0].relative_corners
        sides = [1 / r - 1 for r in corners]
        cells = [c / (h * r) for s in surfaces for c, h, r in zip(s.cell, s.half_width, corners)]
        self._corners, self._sides = ([opaque(a) for a in pair] for pair in (corners, sides))
        self._quarter = opaque(sum(sides) + pi / 2)
        self._per_step = opaque(1 / min(STEP, *(c / 2 for c in cells)))
        self._half_widths = [[opaque(h) for h in s.half_width] for s in surfaces]
        self._near, self._reach = opaque(near), opaque(reach)
        # of equal relative corners: all rulings lie between them, with room for rounding
        ends = zip((min, max), (1 - MARGIN, 1 + MARGIN))
        widths = list(zip(*(outline.half_width for outline in outlines)))
        self._plan = [outlines[0].scaled([f * end(pair) for pair in widths]) for end, f in ends]
        low, high = min(s.low for s in surfaces), max(s.high for s in surfaces)
        self._ends = opaque(low - MARGIN * (high - low)), opaque(high + MARGIN * (high - low))
        self._roots = ON_CYLINDER if outlines[0] == outlines[1] else ROOTS

    def reach(self, rays: DeviceRays) -> DrArray:
        """Return the path at which rays come into what holds the wall: between the lesser and the greater
        half-widths, lowest and highest points; inf where they do not."""
        dr, inf = self.backend.dr, self.backend.Float(self.backend.dr.inf)
        (ox, oy, oz), (dx, dy, dz) = rays.origin, rays.direction
        (begins, ends), (enters, leaves) = (
            chord(self.backend, outline, (ox, oy), (dx, dy)) for outline in self._plan
        )
        at = [(z - oz) / dz for z in self._ends]
        level = (oz >= self._ends[0]) & (oz <= self._ends[1])
        low = dr.select(dz == 0, dr.select(level, 0, inf), dr.maximum(dr.minimum(*at), 0))
        high = dr.select(dz == 0, inf, dr.maximum(*at))
        inside, reach = begins <= ends, inf
        for start, stop in (
            (dr.select(inside, ends, enters), leaves),
            (enters, dr.select(inside, begins, leaves)),
        ):
            start = dr.maximum(start, low)
            reach = dr.select(start <= dr.minimum(stop, high), start, reach)
        return dr.select(enters <= leaves, reach, inf)

    def meet(self, rays: DeviceRays) -> Meeting:
        """Return the Meeting of rays with the wall."""
        dr, Float = self.backend.dr, self.backend.Float
        point, line, fold = self._line(rays)
        side = dr.select(rays.inside, Float(1), -1) * fold[0] * fold[1]
        path, place, share = Float(dr.inf), Float(0), Float(0)
        for low, high in self._bounds(point, line):
            found, turn = low <= high, Float(0)
            for _ in range(self._roots):
                s, found, turn, low = self._next_root(rays, fold, side, (low, high), turn, found)
                t, w, over = self._on_ruling(rays, fold, s)
                met = found & (turn > 0) & (t >= -self._near) & (w >= -over) & (w <= 1 + over)
                first = met & (t < path)
                path, place, share = (dr.select(first, a, b) for a, b in ((t, path), (s, place), (w, share)))
                dr.eval(path, place, share)
                if not dr.any(found):
                    break
        front, front_s, rear, rear_s = self._rims(place, fold)
        along = tuple((1 - share) * a + share * b for a, b in zip(front_s, rear_s))
        normal = _cross(along, _minus(rear, front))
        scale = fold[0] * fold[1] * dr.rsqrt(_dot(normal, normal))
        nx, ny, nz = (scale * n for n in normal)
        return Meeting(dr.maximum(path, 0), (nx, ny, nz), Float(dr.inf))

    def _line(self, rays: DeviceRays) -> tuple[Pair, Pair, Pair]:
        """Return (point, direction, fold) of lines in the plan on which the rays lie.

        fold : +1 or -1 in x and in y, times which lines pass the middle in the quarter x >= 0, y >= 0.
        """
        dr = self.backend.dr
        (ox, oy, _), (dx, dy, _) = rays.origin, rays.direction
        # a ray along z is a point: the line through it across its radius
        length, radius = dr.sqrt(dx * dx + dy * dy), dr.sqrt(ox * ox + oy * oy)
        moves, aside = length > 0, radius > 0
        x, y = (
            dr.select(moves, d / length, dr.select(aside, a / radius, b))
            for d, a, b in ((dx, -oy, 0), (dy, ox, 1))
        )
        # the normal (y, -x), away from the middle
        away = dr.copysign(self.backend.Float(1), y * ox - x * oy)
        fold = dr.copysign(self.backend.Float(1), away * y), dr.copysign(self.backend.Float(1), -away * x)
        return (fold[0] * ox, fold[1] * oy), (fold[0] * x, fold[1] * y), fold

    def _bounds(self, point: Pair, line: Pair) -> list[Pair]:
        """Return two intervals of s in which lie all rulings that cross folded lines in the plan."""
        dr = self.backend.dr
        lows, highs = [], []
        for outline, half_width in zip(self._outlines, self._half_widths):
            start, stop = chord(self.backend, outline, point, line)
            ends = [
                self._place([(o + t * d) / h for o, d, h in zip(point, line, half_width)])
                for t in (start, stop)
            ]
            # where the outline is parallel to a line that passes it by
            (rx, ry), (nx, ny) = self._corners, (dr.abs(line[1]), dr.abs(line[0]))
            nearest = self._sides[1] + dr.atan2(ny * half_width[1] * ry, nx * half_width[0] * rx)
            lows.append(dr.select(start <= stop, dr.minimum(*ends), nearest))
            highs.append(dr.select(start <= stop, dr.maximum(*ends), nearest))
        return [(dr.minimum(*pair) - MARGIN, dr.maximum(*pair) + MARGIN) for pair in (lows, highs)]

    def _place(self, relative: Pair) -> DrArray:
        """Return s of relative points of the outline, between -2 and 2 quarters."""
        dr = self.backend.dr
        (x, y), (px, py) = [dr.abs(a) / r for a, r in zip(relative, self._corners)], self._sides
        angle = dr.atan2(dr.maximum(y - py, 0), dr.maximum(x - px, 0))
        s = dr.minimum(y, py) + angle + px - dr.minimum(x, px)
        s = dr.select(relative[0] < 0, 2 * self._quarter - s, s)
        return dr.select(relative[1] < 0, -s, s)

    def _rims(self, s: DrArray, fold: Pair) -> tuple[Vector, Vector, Vector, Vector]:
        """Return points of the front's rim, their derivatives by s, and the same of the rear's."""
        dr, q = self.backend.dr, self._quarter
        s = s - 4 * q * dr.round(s / (4 * q))
        up, s = dr.copysign(self.backend.Float(1), s), dr.abs(s)
        right = dr.select(s > q, self.backend.Float(-1), 1)
        s = dr.minimum(s, 2 * q - s)
        (rx, ry), (px, py) = self._corners, self._sides
        sine, cosine = dr.sincos(dr.clip(s - py, 0, pi / 2))
        x, y = right * rx * (dr.minimum(q - s, px) + cosine), up * ry * (dr.minimum(s, py) + sine)
        along = -up * rx * sine, right * ry * cosine
        out: list[Vector] = []
        for surface, half_width in zip(self._surfaces, self._half_widths):
            (a, b), (da, db) = ([f * h * c for f, h, c in zip(fold, half_width, v)] for v in ((x, y), along))
            z, zx, zy = surface.jet(a, b)
            out += [(a, b, z), (da, db, zx * da + zy * db)]
        return out[0], out[1], out[2], out[3]

    def _next_root(
        self, rays: DeviceRays, fold: Pair, side: DrArray, interval: Pair, turn: DrArray, active: DrArray
    ) -> tuple[DrArray, DrArray, DrArray, DrArray]:
        """Return (root, found, turn, end): the next root of G in an interval, and where to go on from.

        turn : +1 where the root is one at which light passes from its own side, else -1; that of the root
            before, 0 for the first.
        """
        dr, d = self.backend.dr, rays.direction

        def f(s: DrArray) -> Vector:
            front, front_s, rear, rear_s = self._rims(s, fold)
            ruling, ruling_s, ahead = _minus(rear, front), _minus(rear_s, front_s), _minus(rays.origin, front)
            value = _dot(d, _cross(ruling, ahead))
            return (
                side * value,
                side * _dot(d, _minus(_cross(ruling_s, ahead), _cross(ruling, front_s))),
                value,
            )

        low, high = interval
        turn = dr.select(turn == 0, dr.select(f(low)[0] < 0, self.backend.Float(1), -1), -turn)
        dr.eval(turn)

        def turned(s: DrArray) -> Vector:
            value, rate, rest = f(s)
            return turn * value, turn * rate, rest

        count = dr.ceil((high - low) * self._per_step) + 2
        start, stop, found = first_crossing(
            self.backend, turned, (low, dr.select(active, high, low - 1)), count, active
        )
        root = last_root(self.backend, turned, (start, stop), found, self.backend.Float(RESOLUTION))
        dr.eval(root, found, stop)
        return root, found, turn, stop

    def _on_ruling(self, rays: DeviceRays, fold: Pair, s: DrArray) -> tuple[DrArray, DrArray, DrArray]:
        """Return where rays come nearest to the line of a ruling, t and w, and how far w may pass 0 or 1."""
        dr = self.backend.dr
        front, _, rear, _ = self._rims(s, fold)
        ruling, back = _minus(rear, front), _minus(front, rays.origin)
        across = _cross(rays.direction, ruling)
        per = 1 / _dot(across, across)
        t, w = (per * _dot(_cross(back, v), across) for v in (ruling, rays.direction))
        return t, w, self._reach * dr.rsqrt(_dot(ruling, ruling))


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _dot(a: Vector, b: Vector) -> DrArray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
