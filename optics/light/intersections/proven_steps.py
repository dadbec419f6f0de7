"""The first meeting of rays with a surface conic + spline, by steps that are proven to pass none.

Along a ray f(t) is the height of the surface above it, positive before the first meeting.  The rectangle is
cut into boxes, on which second derivatives and heights have proven bounds.  With a <= f'' <= b up to t + X,

    f + f' h + a h^2 / 2  <=  f(t + h)  <=  f + f' h + b h^2 / 2        for 0 <= h <= X.

Up to the first root of the left side there is no meeting: that is a step.  Where the right side has a root
H <= X, f falls on [t, t + H] and has one root there, the first meeting.  Boxes of several sizes give steps;
the longest is taken.

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 8 (a spline lies between the coefficients that
act on a box, and so do its derivatives); J. C. Hart, Sphere tracing, The Visual Computer 12 (1996).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from optics.base.runtime import Backend, DrArray
from thbcad.checks import Floats
from thbcad.sags import Conic
from thbcad.splines import KnotVector

Bounds: TypeAlias = "tuple[DrArray, DrArray, DrArray, DrArray]"  # a, b, a step that height allows, X

FINEST = 64  # boxes in each direction
COARSER = 8  # times: the size of a coarse box
ROOM = 2.0**-10  # of a box: bounds hold so far around it, so that a ray that leaves it gets on
EPS = 2.0**-53
ROUNDINGS = 64  # of a second difference
POLYNOMIAL = 8  # roundings per degree: two of Horner's scheme, the others of the coefficients
POINT = 8  # roundings of a point on a ray: product, sum, and its place in a cell
MOST = 400  # steps
NOT_YET, MET, GONE, BEHIND = range(4)  # how steps end
WIDER = 1 + 2.0**-10  # times H: room for rounding
FALLS = 2.0**-6  # of f'^2, at least f'^2 - 2 b f: then f still falls at WIDER H


@dataclass(frozen=True, eq=False)
class Fall:
    """Path lengths, mm, between which f falls through zero for the first time.

    They are equal where the ray misses the surface: where it ends, or where it begins if that is behind it.
    resolved : f falls all the way from low to high and is positive before, or the miss is proven.  Else f is
    positive before low, and high is the end of the ray.
    """

    low: DrArray
    high: DrArray
    resolved: DrArray


@dataclass(frozen=True, eq=False)
class BoxBounds:
    """Bounds on the boxes of one size, and where a ray leaves its box.

    low : packets (least z_xx, least z_yy, least z_xy, least z).  high : the greatest ones.
    count : boxes in each direction.  per_length : boxes per mm.
    """

    backend: Backend
    low: DrArray
    high: DrArray
    count: int
    half_width: tuple[DrArray, DrArray]
    per_length: tuple[DrArray, DrArray]

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
        dr, Index, axes = self.backend.dr, self.backend.Index, []
        leave = dr.inf
        for s, d, half, per in zip(point, direction, self.half_width, self.per_length):
            position = (s + half) * per
            box = Index(dr.select(position > 0, dr.minimum(position, self.count - 1), 0))
            edge = self.backend.Float(box) + dr.select(d > 0, 1 + ROOM, -ROOM)
            moves = d != 0
            to_edge = (edge - position) / dr.select(moves, d * per, 1)
            leave = dr.minimum(leave, dr.select(moves, to_edge, dr.inf))
            axes.append(box)
        at = axes[0] * self.count + axes[1]
        low, high = (dr.gather(self.backend.Packet, table, at) for table in (self.low, self.high))
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


def first_fall(
    backend: Backend,
    along: Callable[[DrArray], tuple[DrArray, DrArray, Sequence[Bounds]]],
    interval: tuple[DrArray, DrArray],
    active: DrArray,
    errors: tuple[DrArray, DrArray],
    on: DrArray,
) -> Fall:
    """Return the first Fall of f through zero in an interval, for active rays.

    along : t -> f, f' and Bounds for boxes of every size.  errors : of rounding, of f and of f'.
    on : the ray starts on the surface, which it leaves; then the next fall counts.
    A ray that comes so near to the surface that rounding decides is not resolved.
    """
    dr = backend.dr
    first, last = interval
    error, rate_error = errors

    def body(active: DrArray, t: DrArray, high: DrArray, end: DrArray, count: DrArray) -> tuple[DrArray, ...]:
        f, rate, sizes = along(t)
        rest, step, reach = last - t, 0 * t, 0 * t
        for least, greatest, below, leave in sizes:
            within, greatest = dr.minimum(leave, rest), dr.maximum(greatest, 0)
            safe = _least_root(backend, f - error, rate - rate_error, dr.minimum(least, 0))
            step = dr.maximum(step, dr.minimum(within, dr.maximum(safe, below)))
            reach = dr.maximum(reach, _fall(backend, f + error, rate + rate_error, greatest, within))
            falls_on = (leave >= rest) & (rate + rate_error + greatest * rest < 0)
            reach = dr.select(falls_on, 2 * rest, reach)  # to the very end, whatever rounding does
        after = t + step
        met = (f > -error) & (reach > 0)
        starts = t <= first
        positive = (f > error) | (starts & on & (rate > rate_error))
        gone = positive & (after >= last)
        behind = (f < -error) & starts & ~on
        end = backend.Index(dr.select(met, MET, dr.select(gone, GONE, dr.select(behind, BEHIND, NOT_YET))))
        goes_on = (end == NOT_YET) & positive & (after > t) & (count < MOST)
        high = dr.select(met, dr.minimum(t + reach, last), dr.select(behind, t, last))
        return goes_on, dr.select(goes_on, after, t), high, end, count + 1

    none = dr.zeros(backend.Index, dr.width(first))
    state = (active, first + 0, first + 0, none, none)
    _, t, high, end, _ = dr.while_loop(state, lambda active, *_: active, body, mode="symbolic")
    return Fall(dr.select(end == GONE, last, t), high, end != NOT_YET)


def _least_root(backend: Backend, f: DrArray, rate: DrArray, bend: DrArray) -> DrArray:
    """Return the least positive root of f + rate h + bend h^2 / 2 for f > 0 >= bend, inf for none."""
    dr = backend.dr
    root, rises = dr.sqrt(dr.maximum(rate * rate - 2 * bend * f, 0)), rate > 0
    return dr.select(rises, rate + root, 2 * f) / dr.select(rises, dr.abs(bend), root - rate)


def _fall(backend: Backend, f: DrArray, rate: DrArray, bend: DrArray, most: DrArray) -> DrArray:
    """Return a length within which f + rate h + bend h^2 / 2, bend >= 0, falls through zero, 0 for none below
    `most`."""
    dr = backend.dr
    square = rate * rate - 2 * bend * f
    reach = WIDER * 2 * f / (dr.sqrt(dr.maximum(square, 0)) - rate)
    return dr.select((rate < 0) & (square > FALLS * rate * rate) & (reach <= most), reach, 0)


def rounding_errors(
    backend: Backend, knots: Sequence[KnotVector], moduli: float, steepest: float
) -> tuple[float, float, float]:
    """Return bounds of the rounding errors of heights, mm, of heights per mm of coordinates, and of slopes.

    Single precision is too coarse for a proof: these would exceed the resolution, of which a part is taken.

    moduli : mm, the greatest sum of the moduli of a polynomial's coefficients, see `PowerForm.moduli`.
    steepest : no slope of the surface is greater.
    """
    if backend.dtype != np.float64:
        return 0.0, backend.resolution / 64, 0.0
    spline = POLYNOMIAL * EPS * sum(kv.degree for kv in knots) * moduli
    rate = max(2 * kv.degree / np.diff(kv.breaks).min() for kv in knots)
    return spline, POINT * EPS * (1 + steepest), rate * spline + POINT * EPS * steepest


def box_bounds(
    backend: Backend, conic: Conic, half_width: tuple[float, float], knots: Sequence[KnotVector], net: Floats
) -> list[BoxBounds]:
    """Return the BoxBounds of the whole rectangle, of coarse and of fine boxes."""
    spans = max(kv.spans for kv in knots)
    finest = int(min(FINEST, 2 ** np.ceil(np.log2(spans))))
    tables = _finest_bounds(conic, half_width, knots, net, finest)
    half = tuple(map(backend.opaque, half_width))
    out = []
    for count in sorted({1, max(1, finest // COARSER), finest}):
        k = finest // count
        low, high = (
            backend.array(extreme(t.reshape(count, k, count, k, 4), axis=(1, 3)))
            for extreme, t in zip((np.min, np.max), tables)
        )
        per_length = tuple(backend.opaque(count / (2 * h)) for h in half_width)
        out.append(BoxBounds(backend, low, high, count, half, per_length))
    return out


def _finest_bounds(
    conic: Conic, half_width: tuple[float, float], knots: Sequence[KnotVector], net: Floats, count: int
) -> list[Floats]:
    """Return the least and the greatest z_xx, z_yy, z_xy and z on count x count boxes, (count, count, 4)
    each.

    The second derivative of the conic is bounded in all directions at once, as part of z_xx and z_yy.
    """
    bends, heights = _conic_bounds(conic, half_width, count)
    zeros = np.zeros_like(bends)
    tables = [np.empty((count, count, 4)) for _ in range(2)]
    rates = [2 * kv.degree / np.diff(kv.breaks).min() for kv in knots]
    for k, (orders, base) in enumerate(
        (((2, 0), bends), ((0, 2), bends), ((1, 1), zeros), ((0, 0), heights))
    ):
        derived = _derivative(knots[1], _derivative(knots[0], net, orders[0]).T, orders[1]).T
        room = ROUNDINGS * EPS * float(np.abs(net).max()) * rates[0] ** orders[0] * rates[1] ** orders[1]
        for table, extreme, conics, away in zip(tables, (np.minimum, np.maximum), base, (-room, room)):
            along_x = _over_boxes(knots[0], derived, orders[0], count, extreme)
            along_y = _over_boxes(knots[1], along_x.T, orders[1], count, extreme).T
            table[..., k] = along_y + conics + away
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


def _conic_bounds(conic: Conic, half_width: tuple[float, float], count: int) -> tuple[Floats, Floats]:
    """Return the least and greatest second derivative in any direction and height, (2, count, count) each.

    The second derivatives of z(r) have the eigenvalues z' / r = c i and z'' = c i^3 with
    i = (1 - (1 + K) c^2 r^2)^(-1/2), which is monotone in r.
    """
    near, far = np.zeros((count, count)), np.zeros((count, count))
    for h, shape in zip(half_width, ((-1, 1), (1, -1))):
        low, high = _intervals(h, count)
        across = np.where(low * high < 0, 0.0, np.minimum(abs(low), abs(high)))
        near, far = near + (across**2).reshape(shape), far + (np.maximum(-low, high) ** 2).reshape(shape)
    c = 1 / conic.radius
    inverse = [1 / np.sqrt(1 - (1 + conic.constant) * c * c * r2) for r2 in (near, far)]
    bends = np.array([c * i**k for i in inverse for k in (1, 3)])
    heights = np.array([c * r2 / (1 + 1 / i) for r2, i in zip((near, far), inverse)])
    return _outward(bends), _outward(heights)


def _outward(values: Floats) -> Floats:
    """Return (least, greatest) of values, with room for their rounding."""
    room = ROUNDINGS * EPS * abs(values).max(axis=0)
    return np.array([values.min(axis=0) - room, values.max(axis=0) + room])
