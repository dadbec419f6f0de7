"""Tensor-product B-spline surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import NdBSpline

from thbcad.checks import Floats, points, rebuilt, require_orders, require_type
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.sparse_operators import tensor_apply
from thbcad.splines.spline_verbs import Polynomial, Surface, checked_net


@dataclass(frozen=True, eq=False)
class BSplineSurface(Polynomial, Surface):
    """S(u, v) = sum_ij N_i(u) N_j(v) c_ij with coefficients (n_u, n_v) or (n_u, n_v, d).

    Raises
    ------
    ValueError : kv_u or kv_v that is no KnotVector; coefficients of another shape, or not finite.

    Examples
    --------
    >>> kv = KnotVector.uniform(degree=2, spans=2)
    >>> plane = BSplineSurface(kv, kv, kv.greville()[:, None] + kv.greville())  # z = u + v
    >>> plane([0.25], [0.5]).tolist(), round(float(plane.integral()), 12)
    ([0.75], 1.0)
    """

    kv_u: KnotVector
    kv_v: KnotVector
    coefficients: Floats

    def __post_init__(self) -> None:
        for name in ("kv_u", "kv_v"):
            require_type(name, getattr(self, name), KnotVector)
        c = checked_net(self.coefficients, (self.kv_u.dim, self.kv_v.dim))
        object.__setattr__(self, "coefficients", c)

    __reduce__ = rebuilt

    def __repr__(self) -> str:
        rows, columns, *rest = self.coefficients.shape
        values = f"points in {rest[0]} dimensions" if rest else "scalar coefficients"
        return f"BSplineSurface(degree {self.kv_u.degree, self.kv_v.degree}, {rows} x {columns} {values})"

    def __call__(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return the values at scattered points (u_k, v_k), (n,) or (n, d).

        Raises
        ------
        ValueError : points outside the domain or NaN, rows of unequal length, an order that is not a
            non-negative integer.
        """
        u, v = points(u, v)
        derivative = require_orders(derivative)
        for kv, x in ((self.kv_u, u), (self.kv_v, v)):
            kv.require_inside(x)
        if derivative[0] > self.kv_u.degree or derivative[1] > self.kv_v.degree:
            return np.zeros((len(u), *self.coefficients.shape[2:]))
        result: Floats = self._scattered(np.column_stack([u, v]), nu=derivative)
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
        a, b = self.kv_u.collocation(u, order_u), self.kv_v.collocation(v, order_v)
        return tensor_apply(a, b, self.coefficients)

    def integral(self) -> np.float64 | Floats:
        """Return the integral over the domain, exact: sum_ij I_i I_j c_ij."""
        result: np.float64 | Floats = np.einsum(
            "i,j,ij...->...", self.kv_u.integrals(), self.kv_v.integrals(), self.coefficients
        )
        return result
