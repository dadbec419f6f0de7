"""Tensor-product splines on Dr.Jit arrays, as one polynomial per cell.

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
from optics.light.intersections.box_bounds import spline_bounds
from optics.light.intersections.spans import Cells, SpanFunctions, power_map
from thbcad.checks import Floats
from thbcad.lens import steepest
from thbcad.splines import BSplineSurface, KnotVector

AT_ONCE = 4096  # cells, whose coefficients stay in the processor's memory


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
        across, along = self.knots
        sag = BSplineSurface(across, along, self.net)
        return float(np.hypot(steepest(sag, 0), steepest(sag, 1)))

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
