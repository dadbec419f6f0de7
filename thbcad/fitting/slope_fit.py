"""Surfaces from slopes: least squares in a THB space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from thbcad.checks import Floats
from thbcad.hierarchy import MultilevelBasis
from thbcad.surfaces import THBSurface

if TYPE_CHECKING:
    from thbcad.hierarchy import THBSpace

STEPS = 60  # of conjugate gradients


def fit_slopes(space: THBSpace, x: Floats, y: Floats, zx: Floats, zy: Floats, weight: Floats) -> THBSurface:
    """Return the THB surface over x, y in mm whose slopes fit (zx, zy) on a grid best.

    weight : (nx, ny), of the squares.  Least squares by conjugate gradients in the multilevel system.
    The constant that slopes leave open is chosen so that the greatest and the least coefficient are opposite.
    """
    basis, embedding = MultilevelBasis(space), space.embedding
    (a0, a1), (b0, b1) = (
        (kv.collocation(s), kv.collocation(s, 1)) for kv, s in ((embedding.kv_u, x), (embedding.kv_v, y))
    )
    a0t, a1t, b0t, b1t = (m.T.tocsr() for m in (a0, a1, b0, b1))

    def transposed(gx: Floats, gy: Floats) -> Floats:
        net = a1t @ (b0t @ gx.T).T + a0t @ (b1t @ gy.T).T
        return basis.adjoint(embedding.adjoint(net))

    def normal(weights: Floats) -> Floats:
        net = embedding.coefficients(basis.coefficients(weights))
        return transposed(weight * (b0 @ (a1 @ net).T).T, weight * (b1 @ (a0 @ net).T).T)

    system = LinearOperator((basis.size, basis.size), matvec=normal, dtype=np.float64)
    weights, _ = cg(system, transposed(weight * zx, weight * zy), rtol=1e-8, maxiter=STEPS)
    c = basis.coefficients(weights)
    return THBSurface(space, c - (c.max() + c.min()) / 2)
