"""Tensor-product B-spline surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import NdBSpline

from thbcad.checks import Floats, coordinates, inside, read_only, require_orders, require_type
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.sparse_operators import tensor_apply
from thbcad.values import Value


@dataclass(frozen=True, eq=False)
class BSplineSurface(Value):
    """S(u, v) = sum_ij N_i(u) N_j(v) c_ij with coefficients (n_u, n_v) or (n_u, n_v, d).

    Raises
    ------
    ValueError : kv_u or kv_v that is no KnotVector; coefficients of another shape, or not finite.

    Examples
    --------
    >>> kv = KnotVector.uniform(degree=2, spans=2)
    >>> plane = BSplineSurface(kv, kv, kv.greville()[:, None] + kv.greville())  # z = u + v
    >>> float(plane(0.25, 0.5)), plane([0.25, 0.5], 0.5).tolist(), round(float(plane.integral()), 12)
    (0.75, [0.75, 1.0], 1.0)
    """

    kv_u: KnotVector
    kv_v: KnotVector
    coefficients: Floats

    def __init__(self, kv_u: KnotVector, kv_v: KnotVector, coefficients: ArrayLike) -> None:
        for name, kv in (("kv_u", kv_u), ("kv_v", kv_v)):
            require_type(name, kv, KnotVector)
        c = read_only(coefficients)
        wanted = (kv_u.dim, kv_v.dim)
        if c.shape[:2] != wanted or c.ndim > 3 or c.size == 0:
            raise ValueError(f"coefficients must have shape {wanted} or {(*wanted, 'd')}, got {c.shape}")
        if not np.isfinite(c).all():
            raise ValueError("coefficients must be finite")
        vars(self).update(kv_u=kv_u, kv_v=kv_v, coefficients=c)

    def __repr__(self) -> str:
        rows, columns, *rest = self.coefficients.shape
        values = f"points in {rest[0]} dimensions" if rest else "scalar coefficients"
        return f"BSplineSurface(degree {self.kv_u.degree, self.kv_v.degree}, {rows} x {columns} {values})"

    def __call__(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return the values at points (u, v), in the shape to which u and v broadcast, and (..., d) of
        coefficients (n_u, n_v, d).

        Raises
        ------
        ValueError : points outside the domain or NaN, shapes that do not broadcast, an order that is not a
            non-negative integer.
        """
        orders = require_orders(derivative)
        u, v = coordinates(u=(u, self.kv_u.domain), v=(v, self.kv_v.domain))
        if orders[0] > self.kv_u.degree or orders[1] > self.kv_v.degree:
            values = np.zeros((*u.shape, *self.coefficients.shape[2:]))
        else:
            at = np.empty((*u.shape, 2))
            at[..., 0], at[..., 1] = u, v
            values = self._scattered(at, nu=orders if any(orders) else None)
        result: Floats = values[()]
        return result

    @cached_property
    def _scattered(self) -> NdBSpline:
        """The same spline in scipy, whose compiled loop over points is the fastest at hand."""
        return NdBSpline(
            (self.kv_u.knots, self.kv_v.knots), self.coefficients, (self.kv_u.degree, self.kv_v.degree)
        )

    def grid(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return the values on the grid u x v, (len(u), len(v)) or (len(u), len(v), d).

        Raises
        ------
        ValueError : parameters outside the domain or NaN, an order that is not a non-negative integer.
        """
        order_u, order_v = require_orders(derivative)
        a = self.kv_u.collocation(inside("u", u, self.kv_u.domain), order_u)
        b = self.kv_v.collocation(inside("v", v, self.kv_v.domain), order_v)
        return tensor_apply(a, b, self.coefficients)

    def insert(self, knots_u: ArrayLike = (), knots_v: ArrayLike = ()) -> BSplineSurface:
        """Return the same surface with knots inserted in u and in v.

        Raises
        ------
        ValueError : as `KnotVector.insert`.
        """
        kv_u, kv_v = self.kv_u.insert(knots_u), self.kv_v.insert(knots_v)
        return BSplineSurface(
            kv_u,
            kv_v,
            tensor_apply(self.kv_u.prolongation(kv_u), self.kv_v.prolongation(kv_v), self.coefficients),
        )

    def elevated(self, degrees: tuple[int, int]) -> BSplineSurface:
        """Return the same surface with (at least) the given degrees in u and in v.

        Raises
        ------
        ValueError : a degree above 10.
        """
        vectors: list[KnotVector] = []
        net = self.coefficients
        for kv, degree in zip((self.kv_u, self.kv_v), degrees):
            rows = net.reshape(len(net), -1)
            while kv.degree < degree:
                kv, rows = kv.elevate(), kv.elevation() @ rows
            net = np.moveaxis(rows.reshape(kv.dim, *net.shape[1:]), 0, 1)
            vectors.append(kv)
        kv_u, kv_v = vectors
        return BSplineSurface(kv_u, kv_v, net)

    def integral(self) -> np.float64 | Floats:
        """Return the integral over the domain, exact: sum_ij I_i I_j c_ij."""
        result: np.float64 | Floats = np.einsum(
            "i,j,ij...->...", self.kv_u.integrals(), self.kv_v.integrals(), self.coefficients
        )
        return result
