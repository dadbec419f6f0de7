"""Sampled functions, and sample points on the leaf cells of a THB space."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from thbcad.space import THBSpace

Function = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def cell_points(
    space: THBSpace, shares_u: NDArray[np.float64], shares_v: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (u, v), each (cells, n_u n_v): the points at the given shares of every cell's sides, u first, then v."""
    u0, u1, v0, v1 = space.boxes.T[:, :, None]
    u, v = u0 + (u1 - u0) * shares_u, v0 + (v1 - v0) * shares_v
    return np.repeat(u, len(shares_v), axis=1), np.tile(v, len(shares_u))


def gauss_points(space: THBSpace) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return (u, v, weights), (n,) each: Gauss quadrature with (p + 1)(q + 1) points on every leaf cell.

    Exact for products of two splines of the space, and for products of their derivatives.
    """
    (x, wx), (y, wy) = (np.polynomial.legendre.leggauss(kv.degree + 1) for kv in (space.kv_u, space.kv_v))
    u, v = cell_points(space, (1 + x) / 2, (1 + y) / 2)
    u0, u1, v0, v1 = space.boxes.T
    weights = np.outer((u1 - u0) * (v1 - v0), np.outer(wx, wy) / 4)
    return u.ravel(), v.ravel(), weights.ravel()


def evaluate(function: Function, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return function(u, v) as float64, (n,) or (n, d), at points of shape (n,).

    Raises
    ------
    ValueError : values of another shape, or not finite.
    """
    values = np.asarray(function(u, v), dtype=np.float64)
    if values.shape[:1] != u.shape or values.ndim > 2:
        raise ValueError(f"the function must return ({len(u)},) or ({len(u)}, d) values for {len(u)} points, got shape {values.shape}")
    finite = np.isfinite(values.reshape(len(u), -1)).all(axis=1)
    if not finite.all():
        k = int(np.argmin(finite))
        raise ValueError(f"the function is not finite at u = {u[k]}, v = {v[k]}")
    return values
