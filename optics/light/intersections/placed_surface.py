"""A surface of a body, at its place, and where rays meet it first."""

from __future__ import annotations

import numpy as np

from optics.base.runtime import Backend, DrArray
from optics.light.intersections.first_meetings import Approach, Fall, FirstMeetings
from optics.light.intersections.hits import DeviceRays, Vector
from optics.light.intersections.ray_roots import conic_jet, falling_root
from optics.light.intersections.spline_table import PolynomialTable, PowerForm
from thbcad.lens import FreeformSurface
from thbcad.splines import KnotVector

PLAIN = 16  # cells across a conic without a sag, on which its second derivative is bounded
NARROWEST = 1 / 1024  # of the width: narrower cells are not sampled one by one
NEAR = 2.0**-40  # of the half-width: so near to a meeting point a proven fall begins and ends


class PlacedSurface:
    """A FreeformSurface with its vertex at z = vertex, on Dr.Jit arrays.

    low, high : mm, it lies between these z.  cell : lengths in x and y, mm, within which it is smooth.
    """

    def __init__(self, backend: Backend, surface: FreeformSurface, vertex: float) -> None:
        self.backend, self.half_width = backend, surface.half_width
        self._conic, self._table = surface.conic, None
        self._net, self._height = np.zeros((1, 1)), vertex
        self._vertex = backend.opaque(vertex)
        corner = float(surface.conic(*surface.half_width))
        self.low, self.high = vertex + min(corner, 0.0), vertex + max(corner, 0.0)
        hx, hy = self.half_width
        self.cell = hx / 4, hy / 4
        self._near = backend.opaque(NEAR * max(self.half_width))
        if surface.sag is None:
            across, along = (KnotVector.uniform(2, PLAIN, -h, h) for h in self.half_width)
            plain = PowerForm((across, along), np.zeros((PLAIN + 2, PLAIN + 2)), np.zeros(9), 1)
            self._meetings = FirstMeetings(backend, self._conic, self.half_width, plain)
            return
        sag = surface.sag.to_bspline()
        knots = [kv.rescale(-h, h) for kv, h in zip((sag.kv_u, sag.kv_v), self.half_width)]
        self._table = PolynomialTable(backend, knots)
        self._net = sag.coefficients
        form = self._table.form(sag.coefficients)
        self._power = backend.Float(form.table)
        self.low, self.high = self.low + sag.coefficients.min(), self.high + sag.coefficients.max()
        x, y = (max(np.diff(kv.breaks).min(), 2 * h * NARROWEST) for kv, h in zip(knots, self.half_width))
        self.cell = min(x, self.cell[0]), min(y, self.cell[1])
        self._meetings = FirstMeetings(backend, self._conic, self.half_width, form)

    def rim_heights(self, axis: int, end: int) -> tuple[float, float]:
        """Return bounds of z on the rim on the side of an axis, of its first end (0) or its last (-1)."""
        nearest = np.where(np.arange(2) == axis, self.half_width, 0.0)
        conic = [float(self._conic(*at)) for at in (nearest, self.half_width)]  # in r it is monotone
        sag = self._net.take(end, axis)
        return self._height + min(conic) + sag.min(), self._height + max(conic) + sag.max()

    def jet(self, x: DrArray, y: DrArray) -> Vector:
        """Return z, zx, zy."""
        z, zx, zy, *_ = conic_jet(self.backend, self._conic, x, y)
        if self._table is not None:
            sag = self._table(self._power, x, y)
            z, zx, zy = z + sag[0], zx + sag[1], zy + sag[2]
        return z + self._vertex, zx, zy

    def first_fall(
        self,
        rays: DeviceRays,
        below: DrArray,
        interval: tuple[DrArray, DrArray],
        active: DrArray,
        on: DrArray,
    ) -> Fall:
        """Return the first Fall of active rays through the surface, from below it or from above.

        on : the ray starts on the surface, which it leaves.
        """
        dr, d = self.backend.dr, rays.direction
        error = self._meetings.error(rays.origin)
        sign = dr.select(below, self.backend.Float(1), -1)

        def at(t: DrArray) -> Vector:
            x, y, z = rays.at(t)
            return x, y, z - self._vertex

        def f(t: DrArray) -> tuple[DrArray, DrArray]:
            x, y, z = rays.at(t)
            height, zx, zy = self.jet(x, y)
            return sign * (height - z), sign * (d[2] - zx * d[0] - zy * d[1])

        start, stop = interval
        x, y, z = rays.at(start)
        t = start + (self.jet(x, y)[0] - z) / d[2]
        t = dr.select((t > start) & (t < stop), t, 0.5 * (start + stop))
        unknown, near = dr.zeros(self.backend.Index, dr.width(t)), self._near + error
        away = active & ~on  # others rise from the surface where they start: their way back proves nothing
        t, low, high, searched = falling_root(self.backend, f, t, start, stop, unknown, away, near)
        met = away & ~searched & (low < high)
        met = self._meetings.slopes.prove_first(at, d, (start, t), met, error, below)
        fall = self._meetings.fall(Approach(at, d, f, below), interval, active & ~met, error, on)
        near = self._near + 2.0**-50 * dr.abs(t)
        low = dr.select(met, dr.maximum(t - near, start), fall.low)
        high = dr.select(met, dr.minimum(t + near, stop), fall.high)
        return Fall(low, high, fall.resolved | met)
