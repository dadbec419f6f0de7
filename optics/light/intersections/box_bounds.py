"""Bounds of the derivatives and heights of a surface conic + spline on boxes, its rectangle cut evenly.

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 8 (a spline lies between the coefficients that
act on a box, and so do its derivatives).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from optics.base.runtime import PACKED, Backend, DrArray
from thbcad.checks import Floats
from thbcad.sags import Conic
from thbcad.splines import KnotVector

Bounds: TypeAlias = "tuple[DrArray, DrArray, DrArray, DrArray]"  # a, b, a step that height allows, X

FINEST = 64  # boxes in each direction, of slopes
COARSER = 8  # times: the size of the boxes of second derivatives, which bound them within a whole step
ROOM = 2.0**-10  # of a box: bounds hold so far around it, so that a ray that leaves it gets on
EPS = 2.0**-53
ROUNDINGS = 64  # of a second difference, and more than a height or a slope has
ORDERS = (2, 0), (0, 2), (1, 1), (0, 0), (1, 0), (0, 1)  # of the derivatives that have bounds
AROUND = 1  # box
STEEPER = 2.0**-10  # of a ray's rise: by so much at least it exceeds the surface's where that is proven


@dataclass(frozen=True, eq=False)
class Boxes:
    """A rectangle cut evenly.

    count : boxes in each direction.  per_length : boxes per mm.
    """

    backend: Backend
    count: int
    half_width: tuple[DrArray, DrArray]
    per_length: tuple[DrArray, DrArray]

    @classmethod
    def of(cls, backend: Backend, half_width: tuple[float, float], count: int) -> Boxes:
        """Return count x count boxes of a rectangle; half_width : mm."""
        x, y, per_x, per_y = map(backend.opaque, (*half_width, *(count / (2 * h) for h in half_width)))
        return cls(backend, count, (x, y), (per_x, per_y))

    def holding(self, x: DrArray, y: DrArray) -> tuple[list[DrArray], list[DrArray]]:
        """Return the positions of points in either direction, counted in boxes, and the boxes there."""
        dr = self.backend.dr
        positions = [(s + half) * per for s, half, per in zip((x, y), self.half_width, self.per_length)]
        within = (dr.select(p > 0, dr.minimum(p, self.count - 1), 0) for p in positions)
        return positions, [self.backend.Index(p) for p in within]


@dataclass(frozen=True, eq=False)
class BoxBounds:
    """Bounds on boxes, and where a ray leaves its box.

    low : packets (least z_xx, least z_yy, least z_xy, least z).  high : the greatest ones.
    """

    boxes: Boxes
    low: DrArray
    high: DrArray

    def along(
        self,
        point: Sequence[DrArray],
        direction: Sequence[DrArray],
        error: DrArray,
        below: DrArray | bool = True,
    ) -> Bounds:
        """Return the Bounds along rays from points in the direction.

        error : mm, of a height.  below : the ray is below the surface; else f is its height above it.
        """
        backend, leave = self.boxes.backend, self.boxes.backend.dr.inf
        dr = backend.dr
        positions, (i, j) = self.boxes.holding(*point[:2])
        for position, box, d, per in zip(positions, (i, j), direction, self.boxes.per_length):
            edge = backend.Float(box) + dr.select(d > 0, 1 + ROOM, -ROOM)
            moves = d != 0
            to_edge = (edge - position) / dr.select(moves, d * per, 1)
            leave = dr.minimum(leave, dr.select(moves, to_edge, dr.inf))
        at = i * self.boxes.count + j
        low, high = (dr.gather(backend.Packet, table, at) for table in (self.low, self.high))
        dx, dy, dz = direction
        xx, yy, xy = dx * dx, dy * dy, 2 * dx * dy
        least = xx * low[0] + yy * low[1] + xy * dr.select(xy < 0, high[2], low[2])
        greatest = xx * high[0] + yy * high[1] + xy * dr.select(xy < 0, low[2], high[2])
        free = dr.select(dz > 0, (low[3] - point[2] - error) / dr.select(dz > 0, dz, 1), 0)
        if below is True:
            return least, greatest, free, leave
        over = dr.select(dz < 0, (high[3] - point[2] + error) / dr.select(dz < 0, dz, 1), 0)
        turned = (least, -greatest), (greatest, -least), (free, over)
        return *(dr.select(below, a, b) for a, b in turned), leave


@dataclass(frozen=True, eq=False)
class SlopeBounds:
    """Bounds of slopes and heights on all boxes that are at most AROUND boxes away from each box.

    slopes : packets (least z_x, greatest z_x, least z_y, greatest z_y).  heights : pairs, of z.
    """

    boxes: Boxes
    slopes: DrArray
    heights: DrArray

    def prove_first(
        self,
        at: Callable[[DrArray], Sequence[DrArray]],
        direction: Sequence[DrArray],
        interval: tuple[DrArray, DrArray],
        active: DrArray,
        error: DrArray,
        below: DrArray | bool = True,
    ) -> DrArray:
        """Return the mask of active rays that surely meet the surface nowhere before a meeting point.

        From the point back to its start a ray is below the surface as far as it rises more steeply than the
        surface does in its direction, and wherever it is lower than all of the surface around.

        at : ray parameter -> point, z from the vertex.  interval : ray parameters of start and meeting point.
        error : mm, of heights.  below : the ray comes from below the surface, else from above it.
        """
        backend, (dx, dy, dz), first = self.boxes.backend, direction, interval[0]
        dr = backend.dr
        reach = AROUND / dr.maximum(*(dr.abs(d) * per for d, per in zip((dx, dy), self.boxes.per_length)))
        side = dr.select(below, backend.Float(1), -1)
        towards = side * dx > 0, side * dy > 0
        slack = STEEPER * dr.abs(dz)

        def body(active: DrArray, t: DrArray) -> tuple[DrArray, DrArray]:
            middle = dr.maximum(t - reach, first)
            x, y, z = at(middle)
            _, (i, j) = self.boxes.holding(x, y)
            box = i * self.boxes.count + j
            x0, x1, y0, y1 = dr.gather(backend.Packet, self.slopes, box)
            low, high = dr.gather(backend.Pair, self.heights, box)
            rise = dx * dr.select(towards[0], x1, x0) + dy * dr.select(towards[1], y1, y0)
            falls = side * (rise - dz) < -slack
            apart = dr.select(below, low - z, z - high) > error + dr.abs(dz) * (t - middle)
            proven = falls | apart
            return active & proven & (middle > first), dr.select(proven, middle - reach, t)

        _, t = dr.while_loop((active, interval[1] + 0), lambda active, _: active, body, mode="symbolic")
        return active & (t < first)


def slope_bounds(
    backend: Backend, conic: Conic, half_width: tuple[float, float], spline: Sequence[Floats]
) -> SlopeBounds:
    """Return the SlopeBounds of a surface conic + spline, of the spline's `spline_bounds`."""
    low, high = surface_bounds(conic, half_width, spline)
    least, count = np.concatenate([low[..., 3:], -high[..., 3:]], axis=-1), len(low)
    places = np.clip(np.arange(count) + np.arange(-AROUND, AROUND + 1)[:, None], 0, count - 1)
    for axis in (0, 1):
        least = least.take(places, axis).min(axis)
    z0, x0, y0, *greatest = np.moveaxis(least, -1, 0)
    z1, x1, y1 = (-a for a in greatest)
    slopes, heights = (backend.array(np.stack(rows, axis=-1)) for rows in ((x0, x1, y0, y1), (z0, z1)))
    return SlopeBounds(Boxes.of(backend, half_width, count), slopes, heights)


def box_bounds(
    backend: Backend, conic: Conic, half_width: tuple[float, float], spline: Sequence[Floats]
) -> BoxBounds:
    """Return the BoxBounds of a surface conic + spline, of the spline's `spline_bounds`."""
    tables = [t[..., :PACKED] for t in surface_bounds(conic, half_width, spline)]
    count = max(1, len(tables[0]) // COARSER)
    own = len(tables[0]) // count
    low, high = (
        backend.array(extreme(t.reshape(count, own, count, own, PACKED), axis=(1, 3)))
        for extreme, t in zip((np.min, np.max), tables)
    )
    return BoxBounds(Boxes.of(backend, half_width, count), low, high)


def surface_bounds(
    conic: Conic, half_width: tuple[float, float], spline: Sequence[Floats]
) -> tuple[Floats, ...]:
    """Return the `spline_bounds` of conic + spline.

    The second derivative of the conic is bounded in all directions at once, as part of z_xx and z_yy.
    """
    bends, *others = _conic_bounds(conic, half_width, len(spline[0]))
    conics = np.stack([bends, bends, np.zeros_like(bends), *others], axis=-1)
    return tuple(a + b for a, b in zip(spline, conics))


def spline_bounds(knots: Sequence[KnotVector], net: Floats, count: int | None = None) -> tuple[Floats, ...]:
    """Return the least and the greatest derivatives ORDERS of a spline on count x count boxes, (count, count,
    6) each.

    count : None is a power of two, about as many as there are cells.
    """
    count = count or int(min(FINEST, 2 ** np.ceil(np.log2(max(kv.spans for kv in knots)))))
    tables = tuple(np.empty((count, count, len(ORDERS))) for _ in range(2))
    rates = [2 * kv.degree / np.diff(kv.breaks).min() for kv in knots]
    for k, orders in enumerate(ORDERS):
        derived = _derivative(knots[1], _derivative(knots[0], net, orders[0]).T, orders[1]).T
        room = ROUNDINGS * EPS * float(np.abs(net).max()) * rates[0] ** orders[0] * rates[1] ** orders[1]
        for table, extreme, away in zip(tables, (np.minimum, np.maximum), (-room, room)):
            along_x = _over_boxes(knots[0], derived, orders[0], count, extreme)
            table[..., k] = _over_boxes(knots[1], along_x.T, orders[1], count, extreme).T + away
    return tables


def _derivative(kv: KnotVector, net: Floats, order: int) -> Floats:
    """Return the coefficients of a derivative by the first axis, p (c_(i+1) - c_i) / (t_(i+p+1) - t_(i+1)).

    They are infinite at a kink.
    """
    for done in range(order):
        p, knots = kv.degree - done, kv.knots[done + 1 : len(kv.knots) - done - 1]
        widths, change = (knots[p:] - knots[:-p])[:, None], p * np.diff(net, axis=0)
        net = np.divide(change, widths, out=np.where(change > 0, np.inf, -np.inf), where=widths > 0)
        net[(change == 0) & (widths == 0)] = 0.0
    return net


def _over_boxes(kv: KnotVector, net: Floats, order: int, count: int, extreme: np.ufunc) -> Floats:
    """Return the extremes of the coefficients of a derivative that act on each of `count` intervals."""
    low, high = _intervals(kv.breaks[-1], count)
    span = (np.clip(np.searchsorted(kv.breaks, s) - 1, 0, kv.spans - 1) for s in (low, high))
    first, last = (np.searchsorted(kv.knots, kv.breaks[s], "right") - 1 for s in span)
    first, last = first - kv.degree, last - order
    out = net[first]
    for k in range(1, int((last - first).max()) + 1):
        out = extreme(out, net[np.minimum(first + k, last)])
    return out


def _intervals(half_width: float, count: int) -> tuple[Floats, Floats]:
    """Return the ends of equal intervals that make up [-half_width, half_width], each widened by its room."""
    ends = np.linspace(-half_width, half_width, count + 1)
    room = 2 * ROOM * (ends[1] - ends[0])
    return np.maximum(ends[:-1] - room, -half_width), np.minimum(ends[1:] + room, half_width)


def _conic_bounds(conic: Conic, half_width: tuple[float, float], count: int) -> list[Floats]:
    """Return the least and greatest second derivative in any direction, height, z_x and z_y, (2, count,
    count) each.

    The second derivatives of z(r) have the eigenvalues z' / r = c i and z'' = c i^3 with
    i = (1 - (1 + K) c^2 r^2)^(-1/2), which is monotone in r; z_x is c i x.
    """
    near, far = np.zeros((count, count)), np.zeros((count, count))
    sides = []
    for h, shape in zip(half_width, ((-1, 1), (1, -1))):
        low, high = (side.reshape(shape) for side in _intervals(h, count))
        across = np.where(low * high < 0, 0.0, np.minimum(abs(low), abs(high)))
        near, far = near + across**2, far + np.maximum(-low, high) ** 2
        sides.append((low, high))
    c = 1 / conic.radius
    inverse = [1 / np.sqrt(1 - (1 + conic.constant) * c * c * r2) for r2 in (near, far)]
    bends = [c * i**k for i in inverse for k in (1, 3)]
    heights = [c * r2 / (1 + 1 / i) for r2, i in zip((near, far), inverse)]
    slopes = ([c * i * side for i in inverse for side in ends] for ends in sides)
    return [_outward(np.array(values)) for values in (bends, heights, *slopes)]


def _outward(values: Floats) -> Floats:
    """Return (least, greatest) of values, with room for their rounding."""
    room = ROUNDINGS * EPS * abs(values).max(axis=0)
    return np.array([values.min(axis=0) - room, values.max(axis=0) + room])
