"""Where rays in any direction meet a surface: Newton's method on the ray parameter, within brackets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.intersections.first_meetings import Approach, FirstMeetings, steepest_slope
from optics.light.intersections.hits import Hits, Vector, gauge
from optics.light.intersections.ray_roots import conic_distance, conic_jet, falling_root
from optics.light.intersections.spline_table import PolynomialTable, PowerForm
from thbcad.checks import Floats
from thbcad.outlines import Outline
from thbcad.sags import Conic
from thbcad.splines import KnotVector

Surface = Callable[[DrArray, DrArray], list[DrArray]]  # x, y -> z, zx, zy, zxx, zxy, zyy

ABOVE = 1e-3  # of the half-width: room above the highest point of a surface, against rounding


class SearchedHits:
    """Meeting points of rays in any direction, by Newton's method on the ray parameter.

    A ray can meet the surface only where it is above the rectangle, from t_0 to t_1.  There
    f(t) = surface height - ray height falls through zero.  A ray with f(t_0) < 0 or f(t_1) > 0 misses.
    Newton's method starts at the conic's meeting point; without `proven` where as many rays met the surface
    when they did so first.  A step that leaves the bracket of f's signs is
    replaced by halving the bracket.

    Of several meetings the search returns one, as a rule the first.  With `proven` it is the first: of rays
    that are flatter than the surface is steep it is proven by the slopes behind it, or they are led to it by
    steps that pass none, and are not `found` where rounding decides (in single precision nothing is proven).
    A ray that comes over the rectangle above the surface misses it then.  Without knots the surface is the
    conic alone.
    """

    settled = 0.5  # of the resolution: a residual after which one more of Newton's steps is the last
    near = 0.005  # the same without `proven`, of the root of the resolution: the step makes about its square

    def __init__(
        self,
        backend: Backend,
        conic: Conic,
        outline: Outline,
        knots: Sequence[KnotVector] | None = None,
        proven: bool = True,
    ) -> None:
        half_width = outline.half_width
        self._outline = outline
        self._proven = proven and knots is not None
        self._backend, self._conic, self._half_width = backend, conic, half_width
        self._table = None if knots is None else PolynomialTable(backend, knots)
        self._unit = backend.opaque(backend.resolution * max(half_width))
        self._top = max(0.0, float(conic(*half_width))) + ABOVE * max(half_width)
        resolution = backend.resolution
        self._settled = self.settled if self._proven else max(self.settled, self.near * resolution**-0.5)
        self._first: DrArray | None = None  # ray parameters at which rays met the surface first

    def meet(self, origin: Vector, direction: Vector, net: Floats | None = None) -> Hits:
        """Return the Hits of rays.

        origin : mm, z from the surface's vertex.  net : of the sag, needed just where the surface has one.
        """
        dr, sag, power, top = self._backend.dr, None, None, self._top
        if self._table is not None and net is not None:
            sag = self._table.form(net)
            power = self._backend.Float(sag.table)
            top += max(0.0, float(net.max()))
        surface = partial(self._surface, power)
        with dr.suspend_grad():
            o, d = ([dr.detach(a) for a in v] for v in (origin, direction))
            t, first, last, resolved = self._search(surface, sag, top, o, d)
            x, y = self._clip(o[0] + t * d[0], o[1] + t * d[1])
            jet = surface(x, y)
            speed = d[2] - jet[1] * d[0] - jet[2] * d[1]
            hit = (
                (dr.abs(jet[0] - (o[2] + t * d[2])) < self._resolution(o))
                & (first <= t)
                & (t <= last)
                & resolved
            )
            if not self._outline.is_rectangle:
                hit &= gauge(self._backend, self._outline, x, y) <= 1
            met = t, x, y, jet, hit, speed, resolved
            if self._first is None and self._table is not None and not self._proven:
                dr.eval(t)
                self._first = t
            dr.schedule(met)  # with what first needs them, and kept
        if self._table is None and not dr.grad_enabled(origin, direction):
            z, zx, zy, *_ = jet
            return Hits(x=x, y=y, z=z, zx=zx, zy=zy, found=resolved, hit=hit, leaves=(), at=(x, y), dr=dr)
        leaves = () if self._table is None else tuple(self._backend.Float(a) for a in jet[:3])
        dr.enable_grad(*leaves)
        return self._attached(origin, direction, t, (x, y), jet, speed, resolved, hit, leaves)

    def jet(self, hits: Hits, net: Floats) -> tuple[DrArray, ...]:
        """Return z, zx, zy of a sag net alone at the meeting points."""
        if self._table is None:
            raise ValueError("a surface without a sag has no net")
        with self._backend.dr.suspend_grad():
            return tuple(self._table(self._table.power(net), *hits.at)[:3])

    def pull_back(self, hits: Hits, knots: Sequence[KnotVector] | None = None) -> Floats:
        """Return dL/dC on the surface's knots, or on other knots over the same rectangle."""
        table = self._table if knots is None else PolynomialTable(self._backend, knots)
        if table is None:
            raise ValueError("a surface without a sag has no coefficients")
        return table.pull_back(*hits.at, hits.taken_gradients())

    def _search(
        self, surface: Surface, sag: PowerForm | None, top: float, o: list[DrArray], d: list[DrArray]
    ) -> tuple[DrArray, DrArray, DrArray, DrArray]:
        """Return (ray parameter, t_0, t_1, resolved); a resolved ray that is not on the surface misses it.

        top : mm, a height above the surface.
        resolved : the search came to an end; with `proven`, with a proof.
        """
        backend, dr = self._backend, self._backend.dr
        first, last = self._span(o, d, backend.opaque(top))
        if self._first is not None and dr.width(self._first) == dr.width(first):
            t = self._first
        else:
            t = conic_distance(backend, self._conic, o, d)
        above = first < last
        t = dr.select((t > first) & (t < last), t, 0.5 * (first + last))
        t = dr.select(above, t, 0)  # a number also for rays that are never above the rectangle

        def f(t: DrArray) -> tuple[DrArray, DrArray]:
            z, zx, zy, *_ = surface(*self._clip(o[0] + t * d[0], o[1] + t * d[1]))
            return z - (o[2] + t * d[2]), d[2] - zx * d[0] - zy * d[1]

        search = partial(falling_root, backend, f)
        tolerance, unknown = self._settled * self._resolution(o), dr.zeros(backend.Index, dr.width(t))
        t, low, high, active = search(t, first, last, unknown, above, tolerance)
        resolved = dr.isfinite(sum(o) + sum(d))
        if not self._proven or sag is None:
            return t, first, last, resolved & ~active
        steepest = steepest_slope(self._conic, self._half_width, sag) * (1 + backend.resolution)
        doubtful = above & (backend.opaque(steepest) * dr.sqrt(d[0] * d[0] + d[1] * d[1]) >= d[2])
        if dr.any(doubtful):
            meetings = FirstMeetings(backend, self._conic, self._half_width, sag)
            rays = Approach(lambda t: [a + t * b for a, b in zip(o, d)], d, f)
            met = doubtful & ~active & (low < high)
            doubtful &= ~meetings.slopes.prove_first(rays.at, d, (first, t), met, self._resolution(o))
            dr.eval(t, active, doubtful)
            if dr.any(doubtful):
                fall = meetings.fall(rays, (first, last), doubtful, meetings.error(o), doubtful & False)
                if backend.dtype is np.float64:
                    resolved &= fall.resolved | ~doubtful
                known = dr.select(fall.low < fall.high, 1, unknown)
                found, _, _, searched = search(fall.low, fall.low, fall.high, known, doubtful, tolerance)
                t, active = dr.select(doubtful, found, t), dr.select(doubtful, searched, active)
        return t, first, last, resolved & ~active

    def _span(self, o: list[DrArray], d: list[DrArray], top: DrArray) -> tuple[DrArray, DrArray]:
        """Return the ray parameters between which a ray is above the rectangle and not above `top`."""
        dr, Float = self._backend.dr, self._backend.Float
        first = dr.zeros(Float, max(dr.width(a) for a in (*o, *d)))
        last = dr.select(d[2] > 0, (top - o[2]) / dr.select(d[2] > 0, d[2], 1), dr.inf) + first
        for a, h in zip((0, 1), self._half_width):
            moves = d[a] != 0
            speed = dr.select(moves, d[a], 1)
            ends = (-h - o[a]) / speed, (h - o[a]) / speed
            inside = dr.abs(o[a]) <= h
            first = dr.select(moves, dr.maximum(first, dr.minimum(*ends)), dr.select(inside, first, dr.inf))
            last = dr.select(moves, dr.minimum(last, dr.maximum(*ends)), last)
        return first, dr.select(dr.isinf(last), -1, last)  # rays straight down

    def _resolution(self, origin: Sequence[DrArray]) -> DrArray:
        """Return the distance, mm, within which a height counts as the surface's.

        It is in proportion to the lens and to the ray's coordinates.
        """
        return self._unit + self._backend.resolution * sum(abs(a) for a in origin)

    def _attached(
        self,
        origin: Vector,
        direction: Vector,
        t: DrArray,
        point: tuple[DrArray, DrArray],
        jet: Sequence[DrArray],
        speed: DrArray,
        found: DrArray,
        hit: DrArray,
        leaves: tuple[DrArray, ...],
    ) -> Hits:
        """Return Hits that carry the derivatives by the leaves and by the rays.

        They come from one more Newton step, whose length is zero but whose derivatives are not: implicit
        differentiation.  Beyond the rim the step leads to the plane that touches the surface in `point`,
        where the ray passes the rim, so that meeting points leave the surface without a jump.  Derivatives
        by the rays leave out that the plane turns as this point moves.
        """
        dr = self._backend.dr
        z, zx, zy, zxx, zxy, zyy = jet
        leaf_z, leaf_zx, leaf_zy = leaves or (z, zx, zy)
        x, y = (o + t * d for o, d in zip(origin[:2], direction[:2]))
        ray_z = origin[2] + t * direction[2]
        point_z = dr.detach(ray_z)
        dz = ray_z - point_z
        dx, dy = x - point[0], y - point[1]
        rate = dr.select(speed > 0, speed, 1)  # no ray enters along the surface
        beyond = leaf_z + leaf_zx * dx + leaf_zy * dy - ray_z
        fall = direction[2] - leaf_zx * direction[0] - leaf_zy * direction[1]
        dt = dr.select(
            hit, (leaf_z - z + zx * dx + zy * dy - dz) / rate, beyond / dr.select(speed > 0, fall, 1)
        )
        x, y = x + direction[0] * dt, y + direction[1] * dt
        dx, dy = (dr.select(hit, a - b, 0) for a, b in zip((x, y), point))
        return Hits(
            x=x,
            y=y,
            z=point_z + dz + direction[2] * dt,
            zx=leaf_zx + zxx * dx + zxy * dy,
            zy=leaf_zy + zxy * dx + zyy * dy,
            found=found,
            hit=hit,
            leaves=leaves,
            at=point,
            dr=dr,
        )

    def _clip(self, x: DrArray, y: DrArray) -> tuple[DrArray, DrArray]:
        dr, (hx, hy) = self._backend.dr, self._half_width
        return dr.clip(x, -hx, hx), dr.clip(y, -hy, hy)

    def _surface(self, power: DrArray, x: DrArray, y: DrArray) -> list[DrArray]:
        base = conic_jet(self._backend, self._conic, x, y)
        return list(base) if self._table is None else [a + b for a, b in zip(base, self._table(power, x, y))]
