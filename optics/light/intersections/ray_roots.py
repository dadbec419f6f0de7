"""Roots along rays: the first change of sign from below, Newton's method in a bracket; conics."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from optics.base.runtime import Backend, DrArray
from thbcad.sags import Conic

AlongRay = Callable[[DrArray], tuple[DrArray, DrArray, DrArray]]  # t -> f, f', anything
State = tuple[DrArray, ...]

SPLITS = 4  # of one interval, to see whether a hump within it reaches zero
STEPS = 80  # of Newton's method or bisection: 53 bisections exhaust a float64


def first_crossing(
    backend: Backend, f: AlongRay, interval: tuple[DrArray, DrArray], count: DrArray, below: DrArray
) -> tuple[DrArray, DrArray, DrArray]:
    """Return (low, high, found): a bracket of the first change of f from negative to not negative.

    f is sampled at count + 1 positions of the interval.  Where it is negative at both ends of a
    step, rising at the first and falling at the second, the top of the cubic with these values
    and slopes is sampled too, and again within the part that holds the hump.  So a ray that grazes
    a face is seen as long as f has one hump per step.

    below : the mask of rays for which f counts as negative at the start.
    An interval with stop < start is empty.
    """
    dr = backend.dr
    start, stop = interval
    step = (stop - start) / count

    def body(*state: DrArray) -> State:
        _, below, low, base, rise, high, k, split, splits, _ = state
        value, rate, _ = f(high)
        negative = value < 0
        crossing = below & ~negative
        hump = below & negative & (rise > 0) & (rate < 0) & (splits < SPLITS)
        top = _hump_top(backend, (low, base, rise), (high, value, rate))
        advance = ~crossing & ~hump
        on_grid = advance & ~split
        k = dr.select(on_grid, k + 1, k)
        splits = dr.select(on_grid, 0, dr.select(hump, splits + 1, splits))
        following = dr.select(k >= count, stop, start + k * step)
        low, base, rise = (
            dr.select(advance, new, old) for new, old in ((high, low), (value, base), (rate, rise))
        )
        below = dr.select(advance, negative, below)
        high = dr.select(hump, top, dr.select(crossing, high, following))
        return ~crossing & (k <= count), below, low, base, rise, high, k, hump, splits, crossing

    base, rise, _ = f(start)
    one = dr.ones(backend.Float, dr.width(start))
    never = one < 0
    state = (start <= stop, below, start, base, rise, start + step, one, never, 0 * one, never)
    _, _, low, _, _, high, _, _, _, found = dr.while_loop(state, lambda active, *_: active, body)
    return low, high, found


def _hump_top(backend: Backend, first: State, second: State) -> DrArray:
    """Return where the cubic through two points (t, f, f') has its maximum between them."""
    dr = backend.dr
    low, base, rise = first
    high, value, rate = second
    width = high - low
    bend = 3 * (value - base) / width - rise - rate
    root = dr.sqrt(dr.maximum(bend * bend - rise * rate, 0))
    return high - width * (root - rate - bend) / (rise - rate + 2 * root)


def last_root(
    backend: Backend, f: AlongRay, bracket: tuple[DrArray, DrArray], found: DrArray, resolution: DrArray
) -> DrArray:
    """Return the root of f in a bracket where f goes from negative to not negative, seen from its upper end.

    Newton's method from the upper end; steps that leave the bracket are replaced by bisection.
    It ends with a step below resolution + |t| 2^-51.
    """
    dr = backend.dr

    def body(active: DrArray, low: DrArray, high: DrArray, t: DrArray, k: DrArray) -> State:
        value, rate, _ = f(t)
        low, high = dr.select(value < 0, t, low), dr.select(value < 0, high, t)
        after = t - value / rate
        after = dr.select((after >= low) & (after <= high), after, 0.5 * (low + high))
        moves = dr.abs(after - t) > resolution + dr.abs(t) * 2.0**-51
        return moves & (k < STEPS), low, high, after, k + 1

    low, high = bracket
    state = (found, low, high, high + 0, 0 * high)
    return dr.while_loop(state, lambda active, *_: active, body)[3]


def falling_root(
    backend: Backend,
    f: Callable[[DrArray], tuple[DrArray, DrArray]],
    t: DrArray,
    low: DrArray,
    high: DrArray,
    known: DrArray,
    active: DrArray,
    tolerance: DrArray,
) -> tuple[DrArray, DrArray, DrArray, DrArray]:
    """Return (t, bracket's ends, whether the search is not at an end) of a root at which f falls from low to
    high.

    Newton's method from t; a step that leaves the bracket is replaced by halving it, or by its end whose sign
    was not seen yet.  The last step is the one after |f| < tolerance.

    f : t -> (f, -f').  known : bit 0, f > 0 was seen at low; bit 1, f <= 0 at high.
    """
    dr = backend.dr

    def step(
        t: DrArray, low: DrArray, high: DrArray, known: DrArray, active: DrArray, count: DrArray
    ) -> State:
        value, fall = f(t)
        newton = t + value / fall  # not a number on a tangent ray
        before = value > 0
        low, high = dr.select(before, t, low), dr.select(before, high, t)
        other = dr.select(before, high, low)  # the end of the bracket on the other side of the root
        known = known | dr.select(before, 1, 2)
        settled = dr.abs(value) < tolerance
        halved = dr.select(known == 3, 0.5 * (t + other), other)
        t = dr.select((newton > low) & (newton < high), newton, dr.select(settled, t, halved))
        return t, low, high, known, active & ~settled & (low < high), count + 1

    state = t, low, high, known, active, dr.zeros(backend.Index, dr.width(t))
    t, low, high, _, active, _ = dr.while_loop(state, lambda *s: s[4] & (s[5] < STEPS), step, mode="symbolic")
    return t, low, high, active


def conic_distance(
    backend: Backend, conic: Conic, origin: Sequence[DrArray], direction: Sequence[DrArray]
) -> DrArray:
    """Return the ray parameter at which rays meet a conic from the side of -z.

    Where they miss it, it is that of the closest approach.

    With F = c (x^2 + y^2 + (1 + K) z^2) - 2 z the ray has F = A t^2 + 2 B t + C; the wanted root is the
    falling one.
    """
    dr = backend.dr
    c, k = map(backend.opaque, (1.0 / conic.radius, 1.0 + conic.constant))
    (ox, oy, oz), (dx, dy, dz) = origin, direction
    a = c * (dx * dx + dy * dy + k * dz * dz)
    b = c * (ox * dx + oy * dy + k * oz * dz) - dz
    f = c * (ox * ox + oy * oy + k * oz * oz) - 2 * oz
    root = dr.sqrt(dr.maximum(b * b - a * f, 0))
    falling = root - b
    return dr.select(b < 0, f / dr.select(b < 0, falling, 1), -(b + root) / dr.select(a == 0, 1, a))


def conic_jet(
    backend: Backend, conic: Conic, x: DrArray, y: DrArray
) -> tuple[DrArray, DrArray, DrArray, DrArray, DrArray, DrArray]:
    """Return z, zx, zy, zxx, zxy, zyy of a conic on Dr.Jit arrays."""
    c, k = map(backend.opaque, (1.0 / conic.radius, (1.0 + conic.constant) / conic.radius**2))
    r2 = x * x + y * y
    inverse = backend.dr.rsqrt(1 - k * r2)
    slope, bend = c * inverse, c * k * inverse * inverse * inverse
    return (
        c * r2 / (1 + 1 / inverse),
        slope * x,
        slope * y,
        slope + bend * x * x,
        bend * x * y,
        slope + bend * y * y,
    )
