"""Rational B-spline (NURBS) curves and surfaces.

A rational spline is the projection x = (w x) / w of a spline with the homogeneous coefficients
(w_i P_i, w_i).  Linear operators (knot insertion, segments, degree elevation) act on these.

Source: L. Piegl and W. Tiller, The NURBS Book, chapter 4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import (
    Floats,
    floats,
    inside,
    read_only,
    require_order,
    require_orders,
    require_type,
)
from thbcad.splines.bspline_surface import BSplineSurface
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.sparse_operators import tensor_apply
from thbcad.values import Value

GREATEST_WEIGHT = 1e150  # products and quotients of two are finite and not zero


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


@dataclass(frozen=True, eq=False)
class NURBSCurve(Value):
    """C(u) = sum_i w_i N_i(u) P_i / sum_i w_i N_i(u) with points P_i (dim, d) and weights (dim,), or one
    weight for all.

    Raises
    ------
    ValueError : wrong types or shapes; points that are not finite; weights outside 1e-150 .. 1e150.

    Examples
    --------
    >>> quarter = NURBSCurve(
    ...     KnotVector.uniform(degree=2, spans=1), [[2, 0], [2, 2], [0, 2]], [1, np.sqrt(0.5), 1]
    ... )
    >>> np.hypot(*quarter([0.2, 0.5, 0.9]).T).round(15).tolist()  # a circle of radius 2
    [2.0, 2.0, 2.0]
    """

    kv: KnotVector
    points: Floats
    weights: Floats

    def __init__(self, kv: KnotVector, points: ArrayLike, weights: ArrayLike = 1.0) -> None:
        require_type("kv", kv, KnotVector)
        points, weights = _checked(points, weights, (kv.dim,))
        vars(self).update(kv=kv, points=points, weights=weights)

    @classmethod
    def from_homogeneous(cls, kv: KnotVector, coefficients: Floats) -> NURBSCurve:
        """Return the curve with the coefficients (w_i P_i, w_i), (dim, d + 1)."""
        return cls(kv, coefficients[..., :-1] / coefficients[..., -1:], coefficients[..., -1])

    def __repr__(self) -> str:
        n, d = self.points.shape
        return f"NURBSCurve(degree {self.kv.degree}, {n} points in {d} dimensions)"

    @cached_property
    def homogeneous(self) -> Floats:
        """The coefficients (w_i P_i, w_i), (dim, d + 1)."""
        return _homogeneous(self.points, self.weights)

    def __call__(self, u: ArrayLike, derivative: int = 0) -> Floats:
        """Return the points, or their derivatives of any order, at parameters u of any shape, (..., d).

        Raises
        ------
        ValueError : parameters outside the domain or NaN, an order that is not a non-negative integer.
        """
        require_order(derivative)
        u = inside("u", u, self.kv.domain)
        row = u.ravel()
        jet = np.stack([self.kv.collocation(row, k) @ self.homogeneous for k in range(derivative + 1)])
        return quotient(jet[:, None]).reshape(*u.shape, self.points.shape[1])

    def insert(self, knots: ArrayLike) -> NURBSCurve:
        """Return the same curve with knots inserted."""
        kv = self.kv.insert(knots)
        return NURBSCurve.from_homogeneous(kv, self.kv.prolongation(kv) @ self.homogeneous)

    def segment(self, start: float, stop: float) -> NURBSCurve:
        """Return the piece of the curve over [start, stop]."""
        kv, operator = self.kv.segment(start, stop)
        return NURBSCurve.from_homogeneous(kv, operator @ self.homogeneous)

    def elevate(self) -> NURBSCurve:
        """Return the same curve with the degree raised by one."""
        return NURBSCurve.from_homogeneous(self.kv.elevate(), self.kv.elevation() @ self.homogeneous)

    def transformed(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> NURBSCurve:
        """Return the affine image A C(u) + b.

        matrix : (e, d) float, so that (3, 2) puts a plane curve into space.  offset : (e,) float or one
            number.
        """
        return NURBSCurve(self.kv, _image(self.points, matrix, offset), self.weights)


@dataclass(frozen=True, eq=False)
class NURBSSurface(Value):
    """S(u, v) = sum_ij w_ij N_i(u) N_j(v) P_ij / sum_ij w_ij N_i(u) N_j(v), points (n_u, n_v, d), weights
    (n_u, n_v) or one for all.

    Raises
    ------
    ValueError : wrong types or shapes; points that are not finite; weights outside 1e-150 .. 1e150.

    Examples
    --------
    >>> cone = revolved(line([1.0, 0.0], [0.0, 3.0]))  # of (r, z)
    >>> x, y, z = cone(0.25, 0.4)
    >>> round(float(np.hypot(x, y)), 15), float(z)
    (0.75, 0.75)
    """

    kv_u: KnotVector
    kv_v: KnotVector
    points: Floats
    weights: Floats

    def __init__(
        self, kv_u: KnotVector, kv_v: KnotVector, points: ArrayLike, weights: ArrayLike = 1.0
    ) -> None:
        for name, kv in (("kv_u", kv_u), ("kv_v", kv_v)):
            require_type(name, kv, KnotVector)
        points, weights = _checked(points, weights, (kv_u.dim, kv_v.dim))
        vars(self).update(kv_u=kv_u, kv_v=kv_v, points=points, weights=weights)

    @classmethod
    def from_bspline(cls, surface: BSplineSurface) -> NURBSSurface:
        """Return a polynomial surface with coefficients (n_u, n_v, d) as NURBS with all weights one."""
        require_type("surface", surface, BSplineSurface)
        return cls(surface.kv_u, surface.kv_v, surface.coefficients)

    @classmethod
    def from_homogeneous(cls, kv_u: KnotVector, kv_v: KnotVector, coefficients: Floats) -> NURBSSurface:
        """Return the surface with the coefficients (w_ij P_ij, w_ij), (n_u, n_v, d + 1)."""
        return cls(kv_u, kv_v, coefficients[..., :-1] / coefficients[..., -1:], coefficients[..., -1])

    def __repr__(self) -> str:
        u, v, d = self.points.shape
        return (
            f"NURBSSurface(degree {self.kv_u.degree, self.kv_v.degree}, {u} x {v} points in {d} dimensions)"
        )

    @cached_property
    def homogeneous(self) -> BSplineSurface:
        """The polynomial surface with the coefficients (w_ij P_ij, w_ij), (n_u, n_v, d + 1)."""
        return BSplineSurface(self.kv_u, self.kv_v, _homogeneous(self.points, self.weights))

    def __call__(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return the points, or their derivatives of any order, at parameters u and v that broadcast,
        (..., d).

        Raises
        ------
        ValueError : as `BSplineSurface`.
        """
        return _evaluated(self.homogeneous, u, v, derivative)

    def grid(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Return the same on the grid u x v, (len(u), len(v), d)."""
        return _evaluated(self.homogeneous.grid, u, v, derivative)

    def insert(self, knots_u: ArrayLike = (), knots_v: ArrayLike = ()) -> NURBSSurface:
        """Return the same surface with knots inserted in u and in v."""
        finer = self.homogeneous.insert(knots_u, knots_v)
        return NURBSSurface.from_homogeneous(finer.kv_u, finer.kv_v, finer.coefficients)

    def segment(self, u: tuple[float, float], v: tuple[float, float]) -> NURBSSurface:
        """Return the piece of the surface over the rectangle u[0] .. u[1], v[0] .. v[1]."""
        (kv_u, by_u), (kv_v, by_v) = self.kv_u.segment(*u), self.kv_v.segment(*v)
        return NURBSSurface.from_homogeneous(
            kv_u, kv_v, tensor_apply(by_u, by_v, self.homogeneous.coefficients)
        )

    def to_bezier(self) -> list[NURBSSurface]:
        """Return the same surface as rational Bezier patches, one for each cell, cells in v first."""
        net = tensor_apply(self.kv_u.bezier(), self.kv_v.bezier(), self.homogeneous.coefficients)
        rows, columns = (_spans(kv) for kv in (self.kv_u, self.kv_v))
        return [
            NURBSSurface.from_homogeneous(kv_u, kv_v, net[i, j])
            for (kv_u, i), (kv_v, j) in product(rows, columns)
        ]

    def transformed(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> NURBSSurface:
        """Return the affine image A S(u, v) + b; matrix (e, d), offset (e,) or one number."""
        return NURBSSurface(self.kv_u, self.kv_v, _image(self.points, matrix, offset), self.weights)


def _checked(points: ArrayLike, weights: ArrayLike, shape: tuple[int, ...]) -> tuple[Floats, Floats]:
    """Return both as read-only arrays of the shapes (*shape, d) and shape."""
    points, weights = read_only(points), floats(weights)
    if points.ndim != len(shape) + 1 or points.shape[:-1] != shape or points.size == 0:
        raise ValueError(f"points must have shape {(*shape, 'd')}, got {points.shape}")
    if not np.isfinite(points).all():
        raise ValueError("points must be finite")
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


def _homogeneous(points: Floats, weights: Floats) -> Floats:
    return read_only(np.concatenate([weights[..., None] * points, weights[..., None]], axis=-1))


def _image(points: Floats, matrix: ArrayLike, offset: ArrayLike) -> Floats:
    matrix, offset = (floats(x) for x in (matrix, offset))
    if matrix.ndim != 2 or matrix.shape[1] != points.shape[-1]:
        raise ValueError(
            f"matrix must have {points.shape[-1]} columns, one for each component of the points, got shape "
            f"{matrix.shape}"
        )
    if offset.shape not in ((), matrix.shape[:1]):
        raise ValueError(f"offset must be one number or have shape {matrix.shape[:1]}, got {offset.shape}")
    return points @ matrix.T + offset


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
