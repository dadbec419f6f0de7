"""The first meeting of rays with a surface conic + spline, by steps that are proven to pass none.

Along a ray f(t) is the height of the surface above it, positive before the first meeting.  The rectangle is
cut into boxes, on which second derivatives and heights have proven bounds.  With a <= f'' <= b up to t + X,

    f + f' h + a h^2 / 2  <=  f(t + h)  <=  f + f' h + b h^2 / 2        for 0 <= h <= X.

Up to the first root of the left side there is no meeting: that is a step.  Where the right side has a root
H <= X, f falls on [t, t + H] and has one root there, the first meeting.

Source: J. C. Hart, Sphere tracing, The Visual Computer 12 (1996).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.intersections.box_bounds import EPS, Bounds
from thbcad.splines import KnotVector

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


def first_fall(
    backend: Backend,
    along: Callable[[DrArray], tuple[DrArray, DrArray, Bounds]],
    interval: tuple[DrArray, DrArray],
    active: DrArray,
    errors: tuple[DrArray, DrArray],
    on: DrArray,
) -> Fall:
    """Return the first Fall of f through zero in an interval, for active rays.

    along : t -> f, f' and Bounds.  errors : of rounding, of f and of f'.
    on : the ray starts on the surface, which it leaves; then the next fall counts.
    A ray that comes so near to the surface that rounding decides is not resolved.
    """
    dr = backend.dr
    first, last = interval
    error, rate_error = errors

    def body(active: DrArray, t: DrArray, high: DrArray, end: DrArray, count: DrArray) -> tuple[DrArray, ...]:
        f, rate, (least, greatest, below, leave) = along(t)
        rest = last - t
        within, greatest = dr.minimum(leave, rest), dr.maximum(greatest, 0)
        safe = _least_root(backend, f - error, rate - rate_error, dr.minimum(least, 0))
        after = t + dr.minimum(within, dr.maximum(safe, below))
        reach = _fall(backend, f + error, rate + rate_error, greatest, within)
        falls_on = (leave >= rest) & (rate + rate_error + greatest * rest < 0)
        reach = dr.select(falls_on, 2 * rest, reach)  # to the very end, whatever rounding does
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
