"""Gauss quadrature on the spans of splines."""

from __future__ import annotations

import numpy as np

from thbcad.checks import Floats


def gauss_rule(breaks: Floats, n: int) -> tuple[Floats, Floats]:
    """Return nodes and weights of the Gauss rule with n nodes on every span between breaks, (spans n,) each.

    It is exact for piecewise polynomials of degree 2 n - 1.
    """
    nodes, weights = np.polynomial.legendre.leggauss(n)
    half = np.diff(breaks)[:, None] / 2
    return (breaks[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()
