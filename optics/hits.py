"""Where rays meet the rear surface, and how the surface's changes act there.

Both classes answer the same two questions.  `evaluate(net)` gives the ray's meeting point with
the surface conic + spline(net), with z, zx, zy at that point as differentiable leaves.
`pull_back(...)` turns derivatives by these leaves into derivatives by spline coefficients:

    dL/dC = sum over rays of  gz N_i N_j + gx N_i' N_j + gy N_i N_j'.

The meeting point itself depends on the surface; implicit differentiation puts that into gz,
so that no derivative passes through the iterations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from optics.polynomials import PolynomialTable

if TYPE_CHECKING:
    from scipy.sparse import csc_array, csr_array

    from optics.backend import Backend, DrArray
    from optics.beam import Beam
    from thbcad.bspline import KnotVector
    from thbcad.conic import Conic


@dataclass(eq=False)
class RearHits:
    """Meeting points as Dr.Jit arrays: position (x, y, height above the rear vertex), slopes, mask.

    leaves : the arrays z, zx, zy that carry gradients.  dr : the drjit module.
    """

    x: DrArray
    y: DrArray
    z: DrArray
    zx: DrArray
    zy: DrArray
    hit: DrArray
    leaves: tuple[DrArray, ...]
    dr: ModuleType

    def gradients(self) -> list[NDArray[np.float64]]:
        """Return the derivatives by the leaves (z, zx, zy), each (n,) float."""
        gradients = [leaf.grad for leaf in self.leaves]
        self.dr.eval(gradients)  # together: one kernel
        return [g.numpy() for g in gradients]


class KnownHits:
    """Parallel rays along z: x and y are known before, evaluation is one constant matrix.

    The rays form a grid, so the matrix is a Kronecker product of two sparse ones.  Rays beside
    the rear surface carry hit = False.
    """

    def __init__(self, backend: Backend, beam: Beam, conic: Conic, half_width: tuple[float, float], knots: Sequence[KnotVector]) -> None:
        self._backend = backend
        self.shape = len(beam.x), len(beam.y)
        self._points = [np.clip(s, -h, h) for s, h in zip((beam.x, beam.y), half_width)]
        self._matrices = [_value_and_slope(kv, s) for kv, s in zip(knots, self._points)]
        x, y = self._points[0][:, None], self._points[1][None, :]
        full = np.zeros(self.shape)
        beside = np.abs(x - beam.x[:, None]) + np.abs(y - beam.y[None, :])
        self._hit = backend.array(beside) == 0
        self._x, self._y = (backend.array(a + full) for a in (x, y))
        self._base = [backend.array(conic(x, y, d) + full) for d in ((0, 0), (1, 0), (0, 1))]

    def evaluate(self, net: NDArray[np.float64]) -> RearHits:
        dr = self._backend.dr
        (a0, a1), (b0, b1) = self._matrices
        half = a0 @ net
        sags = (_columns(b0, half), _columns(b0, a1 @ net), _columns(b1, half))
        leaves = tuple(self._backend.array(s) for s in sags)
        dr.enable_grad(*leaves)
        z, zx, zy = (base + leaf for base, leaf in zip(self._base, leaves))
        return RearHits(self._x, self._y, z, zx, zy, self._hit, leaves, dr)

    def pull_back(self, gradients: Sequence[NDArray[np.float64]], knots: Sequence[KnotVector] | None = None) -> NDArray[np.float64]:
        """Return dL/dC on the surface's knots, or on other knots over the same rectangle."""
        matrices = self._matrices if knots is None else [_value_and_slope(kv, s) for kv, s in zip(knots, self._points)]
        (a0, a1), (b0, b1) = matrices
        gz, gx, gy = (g.reshape(self.shape) for g in gradients)
        return a0.T @ (_columns(b0.T, gz) + _columns(b1.T, gy)) + a1.T @ _columns(b0.T, gx)


class SearchedHits:
    """Oblique rays: the meeting point is found by Newton's method on the ray parameter.

    origin, direction : three Dr.Jit arrays each; z counts from the rear vertex.  The search
    starts where the ray meets the plane of the vertex and takes at most `steps` steps; rays that do not
    converge or meet the surface outside the rectangle carry hit = False.
    """

    steps = 12

    def __init__(
        self,
        backend: Backend,
        origin: tuple[DrArray, DrArray, DrArray],
        direction: tuple[DrArray, DrArray, DrArray],
        conic: Conic,
        half_width: tuple[float, float],
        knots: Sequence[KnotVector],
    ) -> None:
        self._backend = backend
        self._origin, self._direction = origin, direction
        self._conic, self._half_width = conic, half_width
        self._table = PolynomialTable(backend, knots)
        self._points: tuple[DrArray, DrArray] | None = None

    def evaluate(self, net: NDArray[np.float64]) -> RearHits:
        dr = self._backend.dr
        self._table.load(net)
        (ox, oy, oz), (dx, dy, dz) = self._origin, self._direction
        with dr.suspend_grad():
            t = -oz / dz
            for _ in range(self.steps):
                x, y = self._clip(ox + t * dx, oy + t * dy)
                z, zx, zy, _, _, _ = self._surface(x, y)
                residual = z - (oz + t * dz)
                t = t + residual / (dz - zx * dx - zy * dy)
                dr.eval(t)
            x, y = ox + t * dx, oy + t * dy
            inside = (dr.abs(x) <= self._half_width[0]) & (dr.abs(y) <= self._half_width[1])
            cx, cy = self._clip(x, y)
            z, zx, zy, zxx, zxy, zyy = self._surface(cx, cy)
            hit = inside & (dr.abs(z - (oz + t * dz)) < self._backend.resolution)
            speed = dz - zx * dx - zy * dy
            dr.eval(z, zx, zy, zxx, zxy, zyy, x, y, hit, speed)
        self._points = cx, cy
        leaves = tuple(self._backend.Float(a) for a in (z, zx, zy))
        dr.enable_grad(*leaves)
        dt = (leaves[0] - z) / speed  # zero, but carries the derivative
        zx = leaves[1] + (zxx * dx + zxy * dy) * dt
        zy = leaves[2] + (zxy * dx + zyy * dy) * dt
        return RearHits(x + dx * dt, y + dy * dt, z + dz * dt, zx, zy, hit, leaves, dr)

    def pull_back(self, gradients: Sequence[NDArray[np.float64]], knots: Sequence[KnotVector] | None = None) -> NDArray[np.float64]:
        table = self._table if knots is None else PolynomialTable(self._backend, knots)
        return table.pull_back(*self._points, gradients)

    def _clip(self, x: DrArray, y: DrArray) -> tuple[DrArray, DrArray]:
        dr, (hx, hy) = self._backend.dr, self._half_width
        return dr.clip(x, -hx, hx), dr.clip(y, -hy, hy)

    def _surface(self, x: DrArray, y: DrArray) -> list[DrArray]:
        base = conic_jet(self._backend, self._conic, x, y)
        return [a + b for a, b in zip(base, self._table(x, y))]


def conic_jet(backend: Backend, conic: Conic, x: DrArray, y: DrArray) -> tuple[DrArray, DrArray, DrArray, DrArray, DrArray, DrArray]:
    """Return z, zx, zy, zxx, zxy, zyy of a conic on Dr.Jit arrays."""
    dr, Float = backend.dr, backend.Float
    # opaque, so that every conic runs the same compiled kernel
    c, k = dr.opaque(Float, 1.0 / conic.radius), dr.opaque(Float, (1.0 + conic.constant) / conic.radius**2)
    r2 = x * x + y * y
    inverse = dr.rsqrt(1 - k * r2)
    slope, bend = c * inverse, c * k * inverse * inverse * inverse
    return c * r2 / (1 + 1 / inverse), slope * x, slope * y, slope + bend * x * x, bend * x * y, slope + bend * y * y


def _value_and_slope(kv: KnotVector, points: NDArray[np.float64]) -> tuple[csr_array, csr_array]:
    return kv.collocation(points), kv.collocation(points, 1)


def _columns(matrix: csr_array | csc_array, array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return array @ matrix.T for a sparse matrix."""
    return (matrix @ array.T).T
