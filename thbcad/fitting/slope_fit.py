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

STEPS = 100  # of conjugate gradients: 60 leave the start of the pearl example at rel_l2 0.092, 100 at 0.068
# Charge for the squares of the weights, relative to the stiffness of one function.  Functions beside the
# grid hardly count in the fit: without it (1e-6) they grow with every step; ten times as much bends the
# surface (0.072).
HELD = 1e-5


def fit_slopes(space: THBSpace, x: Floats, y: Floats, zx: Floats, zy: Floats, weight: Floats) -> THBSurface:
    """Return the THB surface over x, y in mm whose slopes fit (zx, zy) on a grid best.

    weight : (nx, ny), of the squares.  Least squares by conjugate gradients in the multilevel system, whose
        weights are held near zero a little.
    The constant that slopes leave open is chosen so that the greatest and the least coefficient are opposite.
    """
    basis, embedding = MultilevelBasis(space), space.embedding
    (a0, a1), (b0, b1) = (
        (kv.collocation(s), kv.collocation(s, 1)) for kv, s in ((embedding.kv_u, x), (embedding.kv_v, y))
    )
    a0t, a1t, b0t, b1t = (m.T.tocsr() for m in (a0, a1, b0, b1))
    held = HELD * float(weight.mean()) / ((x[1] - x[0]) * (y[1] - y[0]))

    def transposed(gx: Floats, gy: Floats) -> Floats:
        net = a1t @ (b0t @ gx.T).T + a0t @ (b1t @ gy.T).T
        return basis.adjoint(embedding.adjoint(net))

    def normal(weights: Floats) -> Floats:
        net = embedding.coefficients(basis.coefficients(weights))
        fitted: Floats = transposed(weight * (b0 @ (a1 @ net).T).T, weight * (b1 @ (a0 @ net).T).T)
        fitted += held * weights
        return fitted

    system = LinearOperator((basis.size, basis.size), matvec=normal, dtype=np.float64)
    weights, _ = cg(system, transposed(weight * zx, weight * zy), rtol=1e-8, maxiter=STEPS)
    c = basis.coefficients(weights)
    return THBSurface(space, c - (c.max() + c.min()) / 2)
