"""Surfaces on Dr.Jit arrays: conics, and tensor-product splines as one polynomial per cell.

The map from spline coefficients to the power coefficients of every cell is a constant sparse
matrix in each direction; a point then needs its cell and (p + 1)(q + 1) numbers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import PACKED, Backend, DrArray, OrderFreeSums
from optics.light.intersections.box_bounds import Bounds, box_bounds, slope_bounds, spline_bounds
from optics.light.intersections.hits import DeviceRays, Vector
from optics.light.intersections.proven_steps import Fall, first_fall, rounding_errors
from optics.light.intersections.ray_roots import conic_jet, falling_root
from optics.light.intersections.spans import Cells, SpanFunctions, power_map
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface
from thbcad.splines import KnotVector

PLAIN = 16  # cells across a conic without a sag, on which its second derivative is bounded
NARROWEST = 1 / 1024  # of the width: narrower cells are not sampled one by one
AT_ONCE = 4096  # cells, whose coefficients stay in the processor's memory
NEAR = 2.0**-40  # of the half-width: so near to a meeting point a proven fall begins and ends


@dataclass(frozen=True, eq=False)
class PowerForm:
    """A spline with its power coefficients: those of a cell row by row, in whole packets.

    net : (n_x, n_y).  table : flat.  cells : how many there are.
    """

    knots: tuple[KnotVector, ...]
    net: Floats
    table: NDArray[np.floating]
    cells: int

    @cached_property
    def moduli(self) -> float:
        """The greatest sum of the moduli of a cell's power coefficients."""
        table = self.table.reshape(self.cells, -1)
        ones = np.ones(table.shape[1], table.dtype)  # numpy is slow in sums of few numbers, BLAS is not
        return max(float((abs(table[k : k + AT_ONCE]) @ ones).max()) for k in range(0, len(table), AT_ONCE))

    @cached_property
    def steepest(self) -> float:
        """A bound of the slope in any direction."""
        along_x, along_y = (steepest_along(kv, n) for kv, n in zip(self.knots, (self.net, self.net.T)))
        return float(np.hypot(along_x, along_y))

    @cached_property
    def bounds(self) -> tuple[Floats, ...]:
        """See `spline_bounds`."""
        return spline_bounds(self.knots, self.net)


# of the last splines: of a front and a rear, traced again and again
_RECENT: deque[PowerForm] = deque(maxlen=2)


class PolynomialTable:
    """The spline sum_ij N_i(x) N_j(y) C_ij, evaluated anywhere inside its knots."""

    def __init__(self, backend: Backend, knots: Sequence[KnotVector]) -> None:
        self._backend, self._knots = backend, tuple(knots)
        self._maps = [power_map(kv) for kv in knots]
        self._orders = [kv.degree + 1 for kv in knots]
        self._cells = [kv.spans for kv in knots]
        self._find = [Cells(backend, kv.breaks) for kv in knots]
        self._middles = [backend.array((kv.breaks[1:] + kv.breaks[:-1]) / 2) for kv in knots]
        self._rates = [backend.array(2 / np.diff(kv.breaks)) for kv in knots]
        self._functions = [SpanFunctions(backend, kv, m) for kv, m in zip(knots, self._maps)]
        # bounds of the derivatives of all functions by x and by y
        self._steepest = [2 * kv.degree / np.diff(kv.breaks).min() for kv in knots]
        self._packets = -(-self._orders[1] // PACKED)  # that hold the coefficients of a row

    def power(self, net: Floats) -> DrArray:
        """Return the power coefficients of every cell, of the spline with the net (n_x, n_y)."""
        return self._backend.Float(self.form(net).table)

    def form(self, net: Floats) -> PowerForm:
        """Return the PowerForm of the spline with the net (n_x, n_y)."""
        backend = self._backend
        for form in tuple(_RECENT):  # other threads may add to it
            if (
                form.table.dtype == backend.dtype
                and form.knots == self._knots
                and np.array_equal(form.net, net)
            ):
                return form
        ax, ay = self._maps
        cells = ax @ (ay @ net.T).T
        (nx, ny), (p, q) = self._cells, self._orders
        width = self._packets * PACKED
        table = backend.room(nx * ny * p * width)
        table.reshape(nx, ny, p, width)[..., :q] = cells.reshape(nx, p, ny, q).transpose(0, 2, 1, 3)
        form = PowerForm(self._knots, net.copy(), table, nx * ny)
        _RECENT.append(form)
        return form

    def __call__(self, power: DrArray, x: DrArray, y: DrArray) -> tuple[DrArray, ...]:
        """Return z, zx, zy, zxx, zxy, zyy of the spline with these power coefficients."""
        dr = self._backend.dr
        cells, (s, t), (rx, ry) = self._locate(x, y)
        p, q = self._orders
        first = (cells[0] * self._cells[1] + cells[1]) * (p * self._packets)
        z = [0.0] * 6
        for a in reversed(range(p)):
            # value and two derivatives in y of the row's polynomial, by Horner's scheme
            row = [0.0] * 3
            packets = [
                dr.gather(self._backend.Packet, power, first + (a * self._packets + k))
                for k in range(self._packets)
            ]
            for b in reversed(range(q)):
                c = packets[b // PACKED][b % PACKED]
                row = [row[0] * t + c, row[1] * t + row[0], row[2] * t + row[1]]
            r0, r1, r2 = row[0], row[1], 2 * row[2]
            z = [
                z[0] * s + r0,
                z[1] * s + z[0],
                z[2] * s + r1,
                z[3] * s + z[1],
                z[4] * s + z[2],
                z[5] * s + r2,
            ]
        return z[0], z[1] * rx, z[2] * ry, 2 * z[3] * (rx * rx), z[4] * (rx * ry), z[5] * (ry * ry)

    def pull_back(self, x: DrArray, y: DrArray, gradients: Sequence[DrArray]) -> Floats:
        """Return dL/dC, (n_x, n_y), from dL/dz, dL/dzx, dL/dzy at the points.

        A ray adds to whole packets of rows of the net, of which there are PACKED copies: the k-th begins
        with column k, so that in one of them the ray's first function begins a packet.
        """
        dr, Float, Index = self._backend.dr, self._backend.Float, self._backend.Index
        gz, gx, gy = gradients
        cells, local, rates = self._locate(x, y)
        nx, ny = (kv.dim for kv in self._knots)
        width = -(-ny // PACKED) + self._packets  # of a row, in packets
        most = dr.abs(gz) + sum(dr.abs(g) * self._backend.opaque(k) for g, k in zip((gx, gy), self._steepest))
        sums = OrderFreeSums(self._backend, PACKED * nx * width * PACKED, float(dr.sum(most).numpy()[0]))
        (row, across), (column, along) = (f(*at) for f, *at in zip(self._functions, cells, local, rates))
        lines, step = (dr.opaque(Index, number) for number in (nx, width))
        first = (column % PACKED * lines + row) * step + column // PACKED
        for a, (value, slope) in enumerate(across):
            by_value, by_slope = gz * value + gx * slope, gy * value
            parts = [by_value * n + by_slope * m for n, m in along]
            parts += [Float(0)] * (self._packets * PACKED - len(parts))
            for k in range(self._packets):
                sums.add(parts[k * PACKED : (k + 1) * PACKED], first + a * step + k)
        copies = sums.values().numpy().reshape(PACKED, nx, width * PACKED)
        net = np.zeros((nx, ny))
        for k, part in enumerate(copies):
            net[:, k:] += part[:, : ny - k]
        return net

    def _locate(self, x: DrArray, y: DrArray) -> tuple[list[DrArray], list[DrArray], list[DrArray]]:
        """Return the cells, local coordinates in [-1, 1], and their derivatives by x and y."""
        dr, Float = self._backend.dr, self._backend.Float
        cells, local, rates = [], [], []
        for find, middles, per, position in zip(self._find, self._middles, self._rates, (x, y)):
            cell = find(position)
            rate = dr.gather(Float, per, cell)
            cells.append(cell)
            local.append((position - dr.gather(Float, middles, cell)) * rate)
            rates.append(rate)
        return cells, local, rates


def steepest_along(kv: KnotVector, net: Floats) -> float:
    """Return a bound of a spline's derivative along the first direction.

    It is the greatest |p (c_(i+1) - c_i) / (t_(i+p+1) - t_(i+1))|.
    """
    widths = kv.knots[kv.degree + 1 : -1] - kv.knots[1 : -kv.degree - 1]
    return float(np.abs(kv.degree * np.diff(net, axis=0) / widths[:, None]).max())


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
        if surface.sag is None:
            knots = [KnotVector.uniform(2, PLAIN, -h, h) for h in self.half_width]
            self._prove(knots, spline_bounds(knots, np.zeros((PLAIN + 2, PLAIN + 2))), 0.0, 0.0)
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
        self._prove(knots, form.bounds, form.moduli, form.steepest)

    def _prove(
        self, knots: Sequence[KnotVector], spline: Sequence[Floats], moduli: float, steepest: float
    ) -> None:
        backend, conic, half = self.backend, self._conic, self.half_width
        slope = np.hypot(conic(*half, (1, 0)), conic(*half, (0, 1))) + steepest
        self._boxes = box_bounds(backend, conic, half, spline)
        self._slopes = slope_bounds(backend, conic, half, spline)
        self._near = backend.opaque(NEAR * max(half))
        errors = *rounding_errors(backend, knots, moduli, float(slope)), max(half)
        self._errors = [*map(backend.opaque, errors)]

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
        fixed, per_length, slope_error, size = self._errors
        error = fixed + per_length * (size + sum(dr.abs(a) for a in rays.origin))
        sign = dr.select(below, self.backend.Float(1), -1)

        def at(t: DrArray) -> Vector:
            x, y, z = rays.at(t)
            return x, y, z - self._vertex

        def f(t: DrArray) -> tuple[DrArray, DrArray]:
            x, y, z = rays.at(t)
            height, zx, zy = self.jet(x, y)
            return sign * (height - z), sign * (d[2] - zx * d[0] - zy * d[1])

        def along(t: DrArray) -> tuple[DrArray, DrArray, Bounds]:
            value, fall = f(t)
            return value, -fall, self._boxes.along(at(t), d, error, below)

        start, stop = interval
        x, y, z = rays.at(start)
        t = start + (self.jet(x, y)[0] - z) / d[2]
        t = dr.select((t > start) & (t < stop), t, 0.5 * (start + stop))
        unknown, near = dr.zeros(self.backend.Index, dr.width(t)), self._near + error
        away = active & ~on  # others rise from the surface where they start: their way back proves nothing
        t, low, high, searched = falling_root(self.backend, f, t, start, stop, unknown, away, near)
        met = away & ~searched & (low < high)
        met = self._slopes.prove_first(at, d, (start, t), met, error, below)
        fall = first_fall(self.backend, along, interval, active & ~met, (error, slope_error), on)
        near = self._near + 2.0**-50 * dr.abs(t)
        low = dr.select(met, dr.maximum(t - near, start), fall.low)
        high = dr.select(met, dr.minimum(t + near, stop), fall.high)
        return Fall(low, high, fall.resolved | met)
