"""Sample points on the leaf cells of a THB space."""

from __future__ import annotations

import numpy as np

from thbcad.checks import Floats
from thbcad.hierarchy import THBSpace


def cell_points(space: THBSpace, shares_u: Floats, shares_v: Floats) -> tuple[Floats, Floats]:
    """Return (u, v), each (cells, n_u n_v): the points at the given fractions of every cell's sides, u first,
    then v."""
    u0, u1, v0, v1 = space.boxes.T[:, :, None]
    u, v = u0 + (u1 - u0) * shares_u, v0 + (v1 - v0) * shares_v
    return np.repeat(u, len(shares_v), axis=1), np.tile(v, len(shares_u))


def gauss_points(space: THBSpace) -> tuple[Floats, Floats, Floats]:
    """Return (u, v, weights), (n,) each: Gauss quadrature with (p + 1)(q + 1) points on every leaf cell.

    Exact for products of two splines of the space, and for products of their derivatives.
    """
    (x, wx), (y, wy) = (np.polynomial.legendre.leggauss(kv.degree + 1) for kv in (space.kv_u, space.kv_v))
    u, v = cell_points(space, (1 + x) / 2, (1 + y) / 2)
    u0, u1, v0, v1 = space.boxes.T
    weights = np.outer((u1 - u0) * (v1 - v0), np.outer(wx, wy) / 4)
    return u.ravel(), v.ravel(), weights.ravel()
