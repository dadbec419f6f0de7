"""Polynomial B-spline curves and tensor-product surfaces, and interpolation at their Greville points.

Source: C. de Boor, A Practical Guide to Splines, chapter 13.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import NdBSpline, make_interp_spline

from thbcad.checks import Floats, coordinates, floats, inside, require_order, require_orders, require_type
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.sparse_operators import tensor_apply
from thbcad.splines.spline_verbs import Curve, Polynomial, Surface, checked_net

Function = Callable[[Floats, Floats], Floats]


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
        return values.reshape((*u.shape, *self.coefficients.shape[1:]))[()]

    def integral(self) -> np.float64 | Floats:
        """Return the integral over the domain, exact: sum_i I_i c_i."""
        return self.kv.integrals() @ self.coefficients


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
        return values[()]

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


def evaluate(function: Function, u: Floats, v: Floats) -> Floats:
    """Return function(u, v) as float64, (n,) or (n, d), at points of shape (n,).

    Raises ValueError : what is no function; values of another shape, complex or not finite.
    """
    if not callable(function):
        raise ValueError(
            f"a function of u and v is needed, got {type(function).__name__}; fit and least_squares take "
            "points as Samples(u, v, values)"
        )
    values = floats(function(u, v))
    if values.shape[:1] != u.shape or values.ndim > 2:
        raise ValueError(
            f"the function must return ({len(u)},) or ({len(u)}, d) values for {len(u)} points, got shape "
            f"{values.shape}"
        )
    finite = np.isfinite(values.reshape(len(u), -1)).all(axis=1)
    if not finite.all():
        k = int(np.argmin(finite))
        raise ValueError(f"the function is not finite at u = {u[k]}, v = {v[k]}")
    return values


def interpolate(kv_u: KnotVector, kv_v: KnotVector, target: Function | ArrayLike) -> BSplineSurface:
    """Return the spline that takes given values at the Greville points.

    Solves A_u C A_v^T = Z with the collocation matrices at the Greville abscissae.  Other knots are
    clamped first.

    target : a function of u and v, (n,) float each, that returns (n,) or (n, d), or the values Z,
        (kv_u.dim, kv_v.dim) or (kv_u.dim, kv_v.dim, d)

    Raises ValueError : values of another shape, or not finite.
    """
    for name, kv in (("kv_u", kv_u), ("kv_v", kv_v)):
        require_type(name, kv, KnotVector)
    kv_u, kv_v = (kv if kv.is_clamped else kv.clamp()[0] for kv in (kv_u, kv_v))
    u, v = kv_u.greville(), kv_v.greville()
    if callable(target):
        flat = evaluate(target, np.repeat(u, len(v)), np.tile(v, len(u)))
        values = flat.reshape(len(u), len(v), *flat.shape[1:])
    else:
        values = floats(target)
        if values.shape[:2] != (len(u), len(v)) or values.ndim > 3 or not np.isfinite(values).all():
            wanted = f"{(len(u), len(v))} or {(len(u), len(v), 'd')}"
            raise ValueError(f"target must hold finite values of shape {wanted}, got shape {values.shape}")
    by_u = make_interp_spline(u, values, kv_u.degree, t=kv_u.knots).c
    by_v = make_interp_spline(v, np.swapaxes(by_u, 0, 1), kv_v.degree, t=kv_v.knots).c
    return BSplineSurface(kv_u, kv_v, np.swapaxes(by_v, 0, 1))
