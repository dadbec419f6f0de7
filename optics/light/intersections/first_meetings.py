"""The first meeting of rays with a surface conic + spline, proven by its bounds on boxes.

From a meeting point the way back to the ray's start is followed, see `SlopeBounds.prove_first`.  Where it may
cross the surface, steps from the start are proven to pass no meeting.

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
from optics.light.intersections.box_bounds import EPS, box_bounds, slope_bounds
from optics.light.intersections.spline_table import PowerForm
from thbcad.sags import Conic
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


@dataclass(frozen=True, eq=False)
class Approach:
    """Rays on their way to a surface, by the ray parameter t.

    at : t -> x, y, and z from the surface's vertex.  f : t -> height over the rays and its fall, (f, -f');
    before the meeting f is positive.
    below : they come from below the surface, where f is its height less that of the ray; else from above it.
    """

    at: Callable[[DrArray], Sequence[DrArray]]
    direction: Sequence[DrArray]
    f: Callable[[DrArray], tuple[DrArray, DrArray]]
    below: DrArray | bool = True


class FirstMeetings:
    """Proofs of which meeting with a surface conic + spline is a ray's first.

    slopes : see `SlopeBounds`, for proofs from a meeting back to the start.
    """

    def __init__(
        self, backend: Backend, conic: Conic, half_width: tuple[float, float], sag: PowerForm
    ) -> None:
        self._backend = backend
        self._boxes = box_bounds(backend, conic, half_width, sag.bounds)
        self.slopes = slope_bounds(backend, conic, half_width, sag.bounds)
        errors = rounding_errors(backend, sag.knots, sag.moduli, steepest_slope(conic, half_width, sag))
        self._errors = [*map(backend.opaque, (*errors, max(half_width)))]

    def error(self, origin: Sequence[DrArray]) -> DrArray:
        """Return a bound of the rounding errors of f of rays from an origin, mm."""
        fixed, per_length, _, size = self._errors
        return fixed + per_length * (size + sum(self._backend.dr.abs(a) for a in origin))

    def fall(
        self,
        rays: Approach,
        interval: tuple[DrArray, DrArray],
        active: DrArray,
        error: DrArray,
        on: DrArray,
    ) -> Fall:
        """Return the first Fall of f of active rays through zero in an interval.

        error : of f, mm.  on : the ray starts on the surface, which it leaves; then the next fall counts.
        A ray that comes so near to the surface that rounding decides is not resolved.
        """
        backend, dr, rate_error = self._backend, self._backend.dr, self._errors[2]
        first, last = interval

        def body(
            active: DrArray, t: DrArray, high: DrArray, end: DrArray, count: DrArray
        ) -> tuple[DrArray, ...]:
            f, falling = rays.f(t)
            rate, rest = -falling, last - t
            least, greatest, below, leave = self._boxes.along(rays.at(t), rays.direction, error, rays.below)
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
            end = backend.Index(
                dr.select(met, MET, dr.select(gone, GONE, dr.select(behind, BEHIND, NOT_YET)))
            )
            goes_on = (end == NOT_YET) & positive & (after > t) & (count < MOST)
            high = dr.select(met, dr.minimum(t + reach, last), dr.select(behind, t, last))
            return goes_on, dr.select(goes_on, after, t), high, end, count + 1

        none = dr.zeros(backend.Index, dr.width(first))
        state = (active, first + 0, first + 0, none, none)
        _, t, high, end, _ = dr.while_loop(state, lambda active, *_: active, body, mode="symbolic")
        return Fall(dr.select(end == GONE, last, t), high, end != NOT_YET)


def steepest_slope(conic: Conic, half_width: tuple[float, float], sag: PowerForm) -> float:
    """Return a bound of the slope of conic + spline in any direction."""
    x, y = half_width
    return float(np.hypot(conic(x, y, (1, 0)), conic(x, y, (0, 1)))) + sag.steepest


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
