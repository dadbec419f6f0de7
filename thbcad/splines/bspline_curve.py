"""Polynomial B-spline curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats, inside, require_order, require_type
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.spline_verbs import Curve, Polynomial, checked_net


@dataclass(frozen=True, eq=False)
class BSplineCurve(Polynomial, Curve):
    """C(u) = sum_i N_i(u) c_i with coefficients (dim,) or (dim, d).

    Raises
    ------
    ValueError : kv that is no KnotVector; coefficients of another shape, or not finite.

    Examples
    --------
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

        Raises
        ------
        ValueError : parameters outside the domain or NaN, an order that is not a non-negative integer.
        """
        require_order(derivative)
        u = inside("u", u, self.kv.domain)
        values: Floats = self.kv.collocation(u.ravel(), derivative) @ self.coefficients
        return values.reshape(*u.shape, *self.coefficients.shape[1:])[()]

    def integral(self) -> np.float64 | Floats:
        """Return the integral over the domain, exact: sum_i I_i c_i."""
        result: np.float64 | Floats = self.kv.integrals() @ self.coefficients
        return result
