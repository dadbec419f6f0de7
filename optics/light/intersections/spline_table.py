"""Surfaces on Dr.Jit arrays: conics, and tensor-product splines as one polynomial per cell.

The map from spline coefficients to the power coefficients of every cell is a constant sparse
matrix in each direction; a point then needs its cell and (p + 1)(q + 1) numbers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import factorial

import numpy as np
from scipy.sparse import csr_array

from optics.base.runtime import PACKED, Backend, DrArray, OrderFreeSums
from optics.light.intersections.hits import DeviceRays, Vector
from optics.light.intersections.proven_steps import Bounds, Fall, box_bounds, first_fall, rounding_errors
from optics.light.intersections.ray_roots import conic_jet
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface
from thbcad.splines import KnotVector

MOST_BINS = 1 << 16
PLAIN = 16  # cells across a conic without a sag, on which its second derivative is bounded
NARROWEST = 1 / 1024  # of the width: narrower cells are not sampled one by one
ROUNDING = 1e-9  # of a bin: breaks that lie so close to its ends are taken for the ends


# knots, net and power coefficients of the last splines: of a front and a rear, traced again and again
_RECENT: deque[tuple[Sequence[KnotVector], Floats, Floats]] = deque(maxlen=2)


class PolynomialTable:
    """The spline sum_ij N_i(x) N_j(y) C_ij, evaluated anywhere inside its knots."""

    def __init__(self, backend: Backend, knots: Sequence[KnotVector]) -> None:
        self._backend, self._knots = backend, knots
        self._maps = [_power_map(kv) for kv in knots]
        self._orders = [kv.degree + 1 for kv in knots]
        self._cells = [kv.spans for kv in knots]
        self._find = [Cells(backend, kv.breaks) for kv in knots]
        self._middles = [backend.array((kv.breaks[1:] + kv.breaks[:-1]) / 2) for kv in knots]
        self._rates = [backend.array(2 / np.diff(kv.breaks)) for kv in knots]
        # bounds of the derivatives of all powers of s by x, and of t by y
        self._steepest = [2 * kv.degree / np.diff(kv.breaks).min() for kv in knots]
        self._packets = -(-self._orders[1] // PACKED)  # that hold the coefficients of a row

    def power(self, net: Floats) -> DrArray:
        """Return the power coefficients of every cell, of the spline with the net (n_x, n_y)."""
        for knots, known, table in tuple(_RECENT):  # other threads may add to it
            if np.array_equal(known, net) and tuple(knots) == tuple(self._knots):
                return self._backend.array(table)
        ax, ay = self._maps
        cells = ax @ (ay @ net.T).T
        (nx, ny), (p, q) = self._cells, self._orders
        table = np.zeros((nx, ny, p, self._packets * PACKED))
        table[..., :q] = cells.reshape(nx, p, ny, q).transpose(0, 2, 1, 3)
        _RECENT.append((self._knots, net.copy(), table))
        return self._backend.array(table)

    def moduli(self, power: DrArray) -> float:
        """Return the greatest sum of the moduli of a cell's power coefficients."""
        table = power.numpy().reshape(self._cells[0] * self._cells[1], -1)
        return float(abs(table).sum(axis=1).max())

    def __call__(self, power: DrArray, x: DrArray, y: DrArray) -> tuple[DrArray, ...]:
        """Return z, zx, zy, zxx, zxy, zyy of the spline with these power coefficients."""
        dr = self._backend.dr
        first, s, t, rx, ry = self._locate(x, y)
        p, q = self._orders
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

    def pull_back(self, x: DrArray, y: DrArray, gradients: Sequence[Floats]) -> Floats:
        """Return dL/dC, (n_x, n_y), from dL/dz, dL/dzx, dL/dzy at the points."""
        dr, Float = self._backend.dr, self._backend.Float
        gz, gx, gy = (self._backend.array(g) for g in gradients)
        first, s, t, rx, ry = self._locate(x, y)
        (p, q), (nx, ny) = self._orders, self._cells
        width = self._packets * PACKED
        xs, ys = _powers(s, p), _powers(t, q)
        slopes = [0.0, *(b * ry * ys[b - 1] for b in range(1, q))]
        most = dr.abs(gz) + sum(dr.abs(g) * dr.opaque(Float, k) for g, k in zip((gx, gy), self._steepest))
        power = OrderFreeSums(self._backend, nx * ny * p * width, float(dr.sum(most).numpy()[0]))
        for a in range(p):
            across = gz * xs[a] + (gx * (a * xs[a - 1] * rx) if a else 0.0)
            along = gy * xs[a]
            row = [across * ys[b] + along * slopes[b] for b in range(q)] + [Float(0)] * (width - q)
            for k in range(self._packets):
                power.add(row[k * PACKED : (k + 1) * PACKED], first + (a * self._packets + k))
        ax, ay = self._maps
        table = power.values().numpy().reshape(nx, ny, p, width)[..., :q]
        table = table.transpose(0, 2, 1, 3).reshape(nx * p, ny * q)
        return ax.T @ (ay.T @ table.T).T

    def _locate(self, x: DrArray, y: DrArray) -> tuple[DrArray, DrArray, DrArray, DrArray, DrArray]:
        """Return (index of the cell's first packet, local coordinates in [-1, 1], their derivatives by x and
        y)."""
        dr, Float = self._backend.dr, self._backend.Float
        cells, local, rates = [], [], []
        for find, middles, per, position in zip(self._find, self._middles, self._rates, (x, y)):
            cell = find(position)
            rate = dr.gather(Float, per, cell)
            cells.append(cell)
            local.append((position - dr.gather(Float, middles, cell)) * rate)
            rates.append(rate)
        packets = self._orders[0] * self._packets
        return (cells[0] * self._cells[1] + cells[1]) * packets, *local, *rates


class Cells:
    """The spans between breaks, found by bins of equal width.

    A bin knows the span in which it begins; as many steps as breaks lie within a bin lead on from there.
     Breaks of a dyadic mesh lie on the ends of bins and need no step.  A point on a break may be given to
     either side.

    breaks : (n + 1,) float, increasing.
    """

    def __init__(self, backend: Backend, breaks: Floats) -> None:
        dr, self._backend, self._count = backend.dr, backend, len(breaks) - 1
        reach = breaks[-1] - breaks[0]
        bins = int(min(round(reach / np.diff(breaks).min()), MOST_BINS))
        ends = breaks[0] + reach / bins * np.arange(bins + 1)
        room = ROUNDING * reach / bins
        first = np.searchsorted(breaks, ends[:-1] + room, "right") - 1
        self._steps = int((np.searchsorted(breaks, ends[1:] - room, "left") - 1 - first).max())
        self._first, self._breaks = backend.Index(first.astype(np.uint32)), backend.array(breaks)
        # opaque numbers, so that every mesh runs the same compiled kernel
        self._low, self._rate, self._last = (
            dr.opaque(backend.Float, v) for v in (breaks[0], bins / reach, bins - 1)
        )

    def __call__(self, position: DrArray) -> DrArray:
        """Return the numbers of the spans in which points lie, the first and the last for points beside them,
        the first for NaN."""
        dr, Float, Index = self._backend.dr, self._backend.Float, self._backend.Index
        along = (position - self._low) * self._rate
        at = Index(
            dr.select(along > 0, dr.minimum(along, self._last), 0)
        )  # 0 for what is no number: clip keeps it
        cell = dr.gather(Index, self._first, at)
        for _ in range(self._steps):
            passed = (position >= dr.gather(Float, self._breaks, cell + 1)) & (cell + 1 < self._count)
            cell = dr.select(passed, cell + 1, cell)
        return cell


def _powers(s: DrArray, count: int) -> list[DrArray]:
    row = [1.0]
    for _ in range(count - 1):
        row.append(row[-1] * s)
    return row


def _power_map(kv: KnotVector) -> csr_array:
    """Return the matrix from spline coefficients to coefficients of s^k, s in [-1, 1] on each span.

    Row span * (p + 1) + k holds the k-th derivative at the span's middle, times (h / 2)^k / k!.  About the
    middle the moduli of the coefficients sum to at most (1 + sqrt 2)^p times the greatest value, about an end
    to (1 + sqrt 2)^(2 p) times.
    """
    p, half = kv.degree, np.diff(kv.breaks) / 2
    middle = (kv.breaks[1:] + kv.breaks[:-1]) / 2
    rows, columns, values = [], [], []
    for k in range(p + 1):
        first, basis = kv.basis(middle, k)
        rows.append(np.repeat(np.arange(len(middle)) * (p + 1) + k, p + 1))
        columns.append((first[:, None] + np.arange(p + 1)).ravel())
        values.append((basis * (half**k / factorial(k))[:, None]).ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return csr_array(entries, shape=(len(middle) * (p + 1), kv.dim))


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
        self._vertex = backend.dr.opaque(backend.Float, vertex)
        corner = float(surface.conic(*surface.half_width))
        self.low, self.high = vertex + min(corner, 0.0), vertex + max(corner, 0.0)
        hx, hy = self.half_width
        self.cell = hx / 4, hy / 4
        if surface.sag is None:
            knots = [KnotVector.uniform(2, PLAIN, -h, h) for h in self.half_width]
            self._prove(knots, np.zeros((PLAIN + 2, PLAIN + 2)), 0.0)
            return
        sag = surface.sag.to_bspline()
        knots = [kv.rescaled(-h, h) for kv, h in zip((sag.kv_u, sag.kv_v), self.half_width)]
        self._table = PolynomialTable(backend, knots)
        self._power = self._table.power(sag.coefficients)
        self.low, self.high = self.low + sag.coefficients.min(), self.high + sag.coefficients.max()
        x, y = (max(np.diff(kv.breaks).min(), 2 * h * NARROWEST) for kv, h in zip(knots, self.half_width))
        self.cell = min(x, self.cell[0]), min(y, self.cell[1])
        self._prove(knots, sag.coefficients, self._table.moduli(self._power))

    def _prove(self, knots: Sequence[KnotVector], net: Floats, moduli: float) -> None:
        backend, conic, half = self.backend, self._conic, self.half_width
        slope = np.hypot(conic(*half, (1, 0)), conic(*half, (0, 1)))
        along_x, along_y = (steepest_along(kv, n) for kv, n in zip(knots, (net, net.T)))
        slope += np.hypot(along_x, along_y)
        self._boxes = box_bounds(backend, conic, half, knots, net)
        self._errors = [
            backend.dr.opaque(backend.Float, e)
            for e in (*rounding_errors(backend, knots, moduli, float(slope)), max(half))
        ]

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

        def along(t: DrArray) -> tuple[DrArray, DrArray, list[Bounds]]:
            x, y, z = rays.at(t)
            height, zx, zy = self.jet(x, y)
            point = x, y, z - self._vertex
            bounds = [box.along(point, d, error, below) for box in self._boxes]
            return sign * (height - z), sign * (zx * d[0] + zy * d[1] - d[2]), bounds

        return first_fall(self.backend, along, interval, active, (error, slope_error), on)
