"""Tensor-product splines on Dr.Jit arrays, as one polynomial per cell.

The map from spline coefficients to the power coefficients of every cell is a constant sparse
matrix in each direction; a point then needs its cell and (p + 1)(q + 1) numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

if TYPE_CHECKING:
    from optics.backend import Backend, DrArray
    from thbcad.bspline import KnotVector


class PolynomialTable:
    """The spline sum_ij N_i(x) N_j(y) C_ij, evaluated anywhere inside its knots."""

    def __init__(self, backend: Backend, knots: Sequence[KnotVector]) -> None:
        self._backend = backend
        self._maps = [_power_map(kv) for kv in knots]
        self._orders = [kv.degree + 1 for kv in knots]
        self._cells = [kv.spans for kv in knots]
        self._breaks = [backend.array(kv.breaks) for kv in knots]
        self._data: DrArray = None

    def load(self, net: NDArray[np.float64]) -> None:
        """Set the coefficients, (n_x, n_y)."""
        ax, ay = self._maps
        power = ax @ (ay @ net.T).T
        (nx, ny), (p, q) = self._cells, self._orders
        self._data = self._backend.array(power.reshape(nx, p, ny, q).transpose(0, 2, 1, 3))

    def __call__(self, x: DrArray, y: DrArray) -> tuple[DrArray, DrArray, DrArray, DrArray, DrArray, DrArray]:
        """Return z, zx, zy, zxx, zxy, zyy."""
        dr = self._backend.dr
        first, s, t, hx, hy = self._locate(x, y)
        p, q = self._orders
        z = [0.0] * 6
        for a in reversed(range(p)):
            # value and two derivatives in y of the row's polynomial, by Horner's scheme
            row = [0.0] * 3
            for b in reversed(range(q)):
                c = dr.gather(self._backend.Float, self._data, first + (a * q + b))
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
        return z[0], z[1] / hx, z[2] / hy, 2 * z[3] / (hx * hx), z[4] / (hx * hy), z[5] / (hy * hy)

    def pull_back(self, x: DrArray, y: DrArray, gradients: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return dL/dC, (n_x, n_y), from dL/dz, dL/dzx, dL/dzy at the points."""
        dr, Float = self._backend.dr, self._backend.Float
        gz, gx, gy = (self._backend.array(g) for g in gradients)
        first, s, t, hx, hy = self._locate(x, y)
        (p, q), (nx, ny) = self._orders, self._cells
        power = dr.zeros(Float, nx * ny * p * q)
        xs, ys = _powers(s, p), _powers(t, q)
        for a in range(p):
            for b in range(q):
                value = gz * xs[a] * ys[b]
                if a:
                    value += gx * (a * xs[a - 1] / hx) * ys[b]
                if b:
                    value += gy * xs[a] * (b * ys[b - 1] / hy)
                dr.scatter_reduce(dr.ReduceOp.Add, power, value, first + (a * q + b))
        ax, ay = self._maps
        table = power.numpy().reshape(nx, ny, p, q).transpose(0, 2, 1, 3).reshape(nx * p, ny * q)
        return ax.T @ (ay.T @ table.T).T

    def _locate(self, x: DrArray, y: DrArray) -> tuple[DrArray, DrArray, DrArray, DrArray, DrArray]:
        """Return (index of the cell's first coefficient, local coordinates in [0, 1], cell sizes)."""
        dr, Index, Float = self._backend.dr, self._backend.Index, self._backend.Float
        cells, local, sizes = [], [], []
        for breaks, count, position in zip(self._breaks, self._cells, (x, y)):
            at = dr.binary_search(1, count, lambda i, b=breaks, s=position: dr.gather(Float, b, i) <= s)
            cell = Index(dr.minimum(at, count) - 1)
            low = dr.gather(Float, breaks, cell)
            size = dr.gather(Float, breaks, cell + 1) - low
            cells.append(cell)
            local.append((position - low) / size)
            sizes.append(size)
        p, q = self._orders
        return (cells[0] * self._cells[1] + cells[1]) * (p * q), *local, *sizes


def _powers(s: DrArray, count: int) -> list[DrArray]:
    row = [1.0]
    for _ in range(count - 1):
        row.append(row[-1] * s)
    return row


def _power_map(kv: KnotVector) -> csr_array:
    """Return the matrix from spline coefficients to coefficients of s^k, s in [0, 1] on each span.

    Row span * (p + 1) + k holds the k-th derivative at the span's left end, times h^k / k!.
    """
    p, h = kv.degree, np.diff(kv.breaks)
    left = kv.breaks[:-1]
    rows, columns, values = [], [], []
    for k in range(p + 1):
        first, basis = kv.basis(left, k)
        rows.append(np.repeat(np.arange(len(left)) * (p + 1) + k, p + 1))
        columns.append((first[:, None] + np.arange(p + 1)).ravel())
        values.append((basis * (h**k / factorial(k))[:, None]).ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return csr_array(entries, shape=(len(left) * (p + 1), kv.dim))
