"""Rational B-spline (NURBS) curves and surfaces.

A rational spline is the projection x = (w x) / w of a spline with the homogeneous coefficients
(w_i P_i, w_i).  Linear operators (knot insertion, segments, degree elevation) act on these.

Source: L. Piegl and W. Tiller, The NURBS Book, chapter 4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from math import comb
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import (
    Floats,
    floats,
    inside,
    read_only,
    require_number,
    require_order,
    require_orders,
    require_type,
)
from thbcad.splines.bsplines import BSplineCurve, BSplineSurface
from thbcad.splines.knot_removal import thinned
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.sparse_operators import tensor_apply
from thbcad.splines.spline_verbs import Curve, Spline, Surface

GREATEST_WEIGHT = 1e150  # products and quotients of two are finite and not zero
SQRT2 = float(np.sqrt(2))


def quotient(jet: Floats) -> Floats:
    """Return the derivative (a, b) of x = (w x) / w from all lower derivatives of (w x, w).

        x^(a,b) = ((w x)^(a,b) - sum_(i,j) != (0,0) C(a,i) C(b,j) w^(i,j) x^(a-i,b-j)) / w

    jet : (a + 1, b + 1, ..., d + 1) float, derivative (i, j) of (w x, w) in jet[i, j].
    Returns (..., d) float.  Source: The NURBS Book, (4.20).
    """
    weight = jet[..., -1:]
    out = jet[..., :-1].copy()
    for a, b in product(*map(range, jet.shape[:2])):
        for i, j in product(range(a + 1), range(b + 1)):
            if i or j:
                out[a, b] -= comb(a, i) * comb(b, j) * weight[i, j] * out[a - i, b - j]
        out[a, b] /= weight[0, 0]
    result: Floats = out[-1, -1]
    return result


Twin = TypeVar("Twin", BSplineCurve, BSplineSurface)


class Rational(Spline, Generic[Twin]):
    """Verbs of rational splines, by those of polynomial ones."""

    weights: Floats
    rational: ClassVar[bool] = True
    _polynomial: ClassVar[Any]

    @classmethod
    def from_bspline(cls, spline: Twin) -> Self:
        """Return a polynomial spline of points as a rational one with all weights one."""
        require_type("spline", spline, cls._polynomial)
        return cls._made(spline.knot_vectors, spline.coefficients)

    @classmethod
    def from_homogeneous(cls, spline: Twin) -> Self:
        """Return the projection of the polynomial spline with the coefficients (w_i P_i, w_i)."""
        require_type("spline", spline, cls._polynomial)
        net = spline.coefficients
        return cls._made(spline.knot_vectors, net[..., :-1] / net[..., -1:], net[..., -1])

    @cached_property
    def homogeneous(self) -> Twin:
        """The polynomial spline with the coefficients (w_i P_i, w_i), one component more than the points."""
        weights = self.weights[..., None]
        net = np.concatenate([weights * self.coefficients, weights], axis=-1)
        spline: Twin = self._polynomial(*self.knot_vectors, net)
        return spline

    @property
    def net(self) -> Floats:
        """The homogeneous coefficients (w_i P_i, w_i)."""
        return self.homogeneous.coefficients

    def _with(self, knot_vectors: Sequence[KnotVector], net: Floats) -> Self:
        return self.from_homogeneous(self._polynomial(*knot_vectors, net))

    def to_bspline(self) -> Twin:
        """Return the same spline as a polynomial one."""
        if np.ptp(self.weights) != 0:
            raise ValueError(
                f"a rational spline is polynomial where all weights are equal, got {self.weights.min():g} to "
                f"{self.weights.max():g}"
            )
        spline: Twin = self._polynomial(*self.knot_vectors, self.coefficients)
        return spline

    def remove_knots(self, tolerance: float) -> Self:
        """Return a spline on as few of the knots as the search finds, nowhere farther away than a tolerance.

        With points within 1 of the origin and weights of at least w, a net that errs by e moves points by at
        most e sqrt(2) / (w - e), certified but for rounding.
        """
        require_number("tolerance", tolerance, least=0)
        centre = self.coefficients.reshape(-1, self.coefficients.shape[-1]).mean(axis=0)
        reach = float(np.linalg.norm(self.coefficients - centre, axis=-1).max()) or 1.0
        unit = np.eye(len(centre))
        local = self.transform(unit / reach, -centre / reach)
        error = float(self.weights.min()) / (1 + SQRT2 * reach / tolerance) if tolerance else 0.0
        while True:
            knot_vectors, net = thinned(self.knot_vectors, local.net, error)
            if (net[..., -1] > 0).all():
                return self._with(knot_vectors, net).transform(reach * unit, centre)
            error /= 2


@dataclass(frozen=True, eq=False)
class NURBSCurve(Rational[BSplineCurve], Curve):
    """C(u) = sum_i w_i N_i(u) P_i / sum_i w_i N_i(u) with coefficients P_i (dim, d) and weights (dim,), or
    one weight for all.

    Raises ValueError : wrong types or shapes; coefficients that are not finite; weights outside 1e-150 ..
        1e150.

    >>> quarter = NURBSCurve(
    ...     KnotVector.uniform(degree=2, spans=1), [[2, 0], [2, 2], [0, 2]], [1, np.sqrt(0.5), 1]
    ... )
    >>> np.hypot(*quarter([0.2, 0.5, 0.9]).T).round(15).tolist()  # a circle of radius 2
    [2.0, 2.0, 2.0]
    """

    _polynomial = BSplineCurve

    kv: KnotVector
    coefficients: Floats
    weights: Floats

    def __init__(self, kv: KnotVector, coefficients: ArrayLike, weights: ArrayLike = 1.0) -> None:
        require_type("kv", kv, KnotVector)
        points, weights = _checked(coefficients, weights, (kv.dim,))
        vars(self).update(kv=kv, coefficients=points, weights=weights)

    def __repr__(self) -> str:
        n, d = self.coefficients.shape
        return f"NURBSCurve(degree {self.kv.degree}, {n} points in {d} dimensions)"

    def __call__(self, u: ArrayLike, derivative: int = 0) -> Floats:
        """Return the points, or their derivatives of any order, at parameters u of any shape, (..., d).

        Raises ValueError : parameters outside the domain or NaN, an order that is not a non-negative integer.
        """
        require_order(derivative)
        u = inside("u", u, self.kv.domain)
        row = u.ravel()
        jet = np.stack([self.kv.collocation(row, k) @ self.net for k in range(derivative + 1)])
        return quotient(jet[:, None]).reshape(*u.shape, self.coefficients.shape[1])


@dataclass(frozen=True, eq=False)
class NURBSSurface(Rational[BSplineSurface], Surface):
    """S(u, v) = sum_ij w_ij N_i(u) N_j(v) P_ij / sum_ij w_ij N_i(u) N_j(v), coefficients P_ij (n_u, n_v,
    d), weights (n_u, n_v) or one for all.

    Raises ValueError : wrong types or shapes; coefficients that are not finite; weights outside 1e-150 ..
        1e150.

    >>> cone = revolved(line([1.0, 0.0], [0.0, 3.0]))  # of (r, z)
    >>> x, y, z = cone(0.25, 0.4)
    >>> round(float(np.hypot(x, y)), 15), float(z)
    (0.75, 0.75)
    """

    _polynomial = BSplineSurface

    kv_u: KnotVector
    kv_v: KnotVector
    coefficients: Floats
    weights: Floats

    def __init__(
        self, kv_u: KnotVector, kv_v: KnotVector, coefficients: ArrayLike, weights: ArrayLike = 1.0
    ) -> None:
        for name, kv in (("kv_u", kv_u), ("kv_v", kv_v)):
            require_type(name, kv, KnotVector)
        points, weights = _checked(coefficients, weights, (kv_u.dim, kv_v.dim))
        vars(self).update(kv_u=kv_u, kv_v=kv_v, coefficients=points, weights=weights)

    def __repr__(self) -> str:
        u, v, d = self.coefficients.shape
        return (
            f"NURBSSurface(degree {self.kv_u.degree, self.kv_v.degree}, {u} x {v} points in {d} dimensions)"
        )

    def __call__(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return the points, or their derivatives of any order, at parameters u and v that broadcast,
        (..., d).

        Raises ValueError : as `BSplineSurface`.
        """
        return _evaluated(self.homogeneous, u, v, derivative)

    def grid(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return the same on the grid u x v, (len(u), len(v), d)."""
        return _evaluated(self.homogeneous.grid, u, v, derivative)

    def to_bezier(self) -> list[NURBSSurface]:
        """Return the same surface as rational Bezier patches, one for each cell, cells in v first."""
        net = tensor_apply(self.kv_u.bezier(), self.kv_v.bezier(), self.net)
        rows, columns = (_spans(kv) for kv in (self.kv_u, self.kv_v))
        return [self._with([kv_u, kv_v], net[i, j]) for (kv_u, i), (kv_v, j) in product(rows, columns)]


def _checked(points: ArrayLike, weights: ArrayLike, shape: tuple[int, ...]) -> tuple[Floats, Floats]:
    """Return both as read-only arrays of the shapes (*shape, d) and shape."""
    points, weights = read_only(points), floats(weights)
    if points.ndim != len(shape) + 1 or points.shape[:-1] != shape or points.size == 0:
        raise ValueError(f"coefficients must have shape {(*shape, 'd')}, got {points.shape}")
    if not np.isfinite(points).all():
        raise ValueError("coefficients must be finite")
    if weights.shape not in ((), shape):
        raise ValueError(f"weights must be one number or have shape {shape}, got {weights.shape}")
    bad = ~((weights >= 1 / GREATEST_WEIGHT) & (weights <= GREATEST_WEIGHT))
    if bad.any():
        raise ValueError(
            f"weights must lie between {1 / GREATEST_WEIGHT:g} and {GREATEST_WEIGHT:g}, got "
            f"{weights[bad].flat[0]}"
        )
    weights = read_only(np.broadcast_to(weights, shape))
    with np.errstate(over="ignore"):
        beyond = ~np.isfinite(weights[..., None] * points)
    if beyond.any():
        k = tuple(int(i) for i in np.argwhere(beyond)[0][:-1])
        raise ValueError(
            f"points times weights must be finite, got {points[k].tolist()} times {weights[k]:g}"
        )
    return points, weights


def _evaluated(
    spline: Callable[..., Floats], u: ArrayLike, v: ArrayLike, derivative: tuple[int, int]
) -> Floats:
    """Return a derivative of the projection of a spline of homogeneous points, given as function of u, v and
    the derivative."""
    derivative = require_orders(derivative)
    return quotient(
        np.array([[spline(u, v, (i, j)) for j in range(derivative[1] + 1)] for i in range(derivative[0] + 1)])
    )


def _spans(kv: KnotVector) -> list[tuple[KnotVector, slice]]:
    """Return for every span its Bezier knot vector and its rows in the Bezier extraction."""
    n = kv.degree + 1
    return [
        (KnotVector(kv.degree, np.repeat(ends, n)), slice(k * n, (k + 1) * n))
        for k, ends in enumerate(pairwise(kv.breaks))
    ]
