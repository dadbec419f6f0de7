"""Polynomial B-spline curves and tensor-product surfaces."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import NdBSpline

from thbcad.checks import Floats, coordinates, inside, require_order, require_orders, require_type
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.sparse_operators import tensor_apply
from thbcad.splines.spline_verbs import Curve, Polynomial, Surface, checked_net


@dataclass(frozen=True, eq=False)
class BSplineCurve(Polynomial, Curve):
    """C(u) = sum_i N_i(u) c_i with coefficients (dim,) or (dim, d).

    Raises ValueError : kv that is no KnotVector; coefficients of another shape, or not finite.

    >>> kv = KnotVector.uniform(degree=2, spans=1)
    >>> parabola = BSplineCurve(kv, [[0, 0], [1, 0], [2, 4]])  # y = x^2
    >>> parabola(0.5).tolist(), parabola.derivative(1)(0.5).tolist()
    ([1.0, 1.0], [2.0, 4.0])
    >>> parabola.closest_point([3.0, 0.0]).points.round(12).tolist()  # on the normal of slope -1/2
    [1.0, 1.0]
    """

    kv: KnotVector
    coefficients: Floats

    def __init__(self, kv: KnotVector, coefficients: ArrayLike) -> None:
        require_type("kv", kv, KnotVector)
        vars(self).update(kv=kv, coefficients=checked_net(coefficients, (kv.dim,)))

    def __repr__(self) -> str:
        n, *rest = self.coefficients.shape
        values = f"points in {rest[0]} dimensions" if rest else "scalar coefficients"
        return f"BSplineCurve(degree {self.kv.degree}, {n} {values})"

    def __call__(self, u: ArrayLike, derivative: int = 0) -> Floats:
        """Return values, or their derivatives of any order, at parameters of any shape: (...) or (..., d).

        Raises ValueError : parameters outside the domain or NaN, an order that is not a non-negative integer.
        """
        require_order(derivative)
        u = inside("u", u, self.kv.domain)
        values: Floats = self.kv.collocation(u.ravel(), derivative) @ self.coefficients
        return values.reshape(*u.shape, *self.coefficients.shape[1:])[()]

    def integral(self) -> np.float64 | Floats:
        """Return the integral over the domain, exact: sum_i I_i c_i."""
        result: np.float64 | Floats = self.kv.integrals() @ self.coefficients
        return result


@dataclass(frozen=True, eq=False)
class BSplineSurface(Polynomial, Surface):
    """S(u, v) = sum_ij N_i(u) N_j(v) c_ij with coefficients (n_u, n_v) or (n_u, n_v, d).

    Raises ValueError : kv_u or kv_v that is no KnotVector; coefficients of another shape, or not finite.

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
        vars(self).update(kv_u=kv_u, kv_v=kv_v, coefficients=checked_net(coefficients, (kv_u.dim, kv_v.dim)))

    def __repr__(self) -> str:
        rows, columns, *rest = self.coefficients.shape
        values = f"points in {rest[0]} dimensions" if rest else "scalar coefficients"
        return f"BSplineSurface(degree {self.kv_u.degree, self.kv_v.degree}, {rows} x {columns} {values})"

    def __call__(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return the values at points (u, v), in the shape to which u and v broadcast, and (..., d) of
        coefficients (n_u, n_v, d).

        Raises ValueError : points outside the domain or NaN, shapes that do not broadcast, an order that is
            not a non-negative integer.
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

        Raises ValueError : parameters outside the domain or NaN, an order that is not a non-negative integer.
        """
        order_u, order_v = require_orders(derivative)
        a = self.kv_u.collocation(inside("u", u, self.kv_u.domain), order_u)
        b = self.kv_v.collocation(inside("v", v, self.kv_v.domain), order_v)
        return tensor_apply(a, b, self.coefficients)

    def integral(self) -> np.float64 | Floats:
        """Return the integral over the domain, exact: sum_ij I_i I_j c_ij."""
        result: np.float64 | Floats = np.einsum(
            "i,j,ij...->...", self.kv_u.integrals(), self.kv_v.integrals(), self.coefficients
        )
        return result
