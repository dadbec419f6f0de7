"""Polar forms: the one product of bidiagonal matrices on which all B-splines here rest.

On the non-empty knot span ``mu`` the polar form (blossom) of a spline of degree p with
coefficients c is

    f[a_1, ..., a_p] = R_1(a_1) R_2(a_2) ... R_p(a_p) c[mu-p : mu+1],

where ``R_k`` is the k x (k+1) matrix of de Boor's triangle.  Equal arguments give values,
derivatives of the ``R_k`` give derivatives, and the knots of a finer vector give the rows
of the refinement matrix (Oslo algorithm).

Source: T. Lyche and K. Moerken, Spline Methods, chapters 2-4; thesis 3.5-3.9 and 3.30-3.35.
"""

from math import comb

import numpy as np

from thbcad.checks import Floats, Integers


def blossom(near: Floats, arguments: Floats, derivative: int = 0) -> Floats:
    """Return the rows R_1(a_1) ... R_p(a_p) for many spans [t_mu, t_mu+1) at once.

    near : (2 degree, n) float, the knots t_(mu+1-p) ... t_(mu+p) around each span
    arguments : (n, degree) float, arguments of the polar form
    derivative : int, the last `derivative` factors are replaced by k R_k', so that equal
        arguments u give the derivative of that order at u

    Returns (n, degree + 1) float : weights of the coefficients mu - degree ... mu.
    """
    count, degree = arguments.shape
    if derivative > degree:
        return np.zeros((count, degree + 1))
    rows = [np.ones(count)]
    for k in range(1, degree + 1):
        argument = arguments[:, k - 1]
        out = [np.zeros(0)] * (k + 1)
        for r, before in enumerate(rows):
            # function mu - k + 1 + r of degree k - 1 lies on [low, high] = [t_j, t_(j+k)]
            low, high = near[degree + r - k], near[degree + r]
            if k > degree - derivative:
                right = k * before / (high - low)
                left = -right
            else:
                right = before * ((argument - low) / (high - low))
                left = before * ((high - argument) / (high - low))
            out[r] = out[r] + left if r else left
            out[r + 1] = right
        rows = out
    return np.stack(rows, axis=1)


def blossom_rows(
    knots: Floats, degree: int, span: Integers, arguments: Floats, derivative: int = 0
) -> Floats:
    """Return `blossom` for the spans with indices `span`, (n,) int, of a row of knots.

    Raises ValueError : a derivative that is not finite.
    """
    near = np.stack([knots[span + offset] for offset in range(1 - degree, degree + 1)])
    if not derivative:
        return blossom(near, arguments)
    with np.errstate(over="ignore", invalid="ignore"):
        rows = blossom(near, arguments, derivative)
    if not np.isfinite(rows).all():
        raise ValueError(f"derivative {derivative} is beyond float64: knots lie too near to each other")
    return rows


def bezier_rows(near: Floats) -> Floats:
    """Return the Bezier extraction of many spans [a, b] from the knots around them: (2 degree, n) -> (n,
    degree + 1, degree + 1).

    Coefficient k of a span is the polar form at degree - k times a and k times b.
    """
    p = len(near) // 2
    n = near.shape[1]
    late = np.arange(p) >= p - np.arange(p + 1)[:, None]
    arguments = np.moveaxis(near[p - 1 + late], -1, 0).reshape(n * (p + 1), p)
    return blossom(np.repeat(near, p + 1, axis=1), arguments).reshape(n, p + 1, p + 1)


def halves(degree: int) -> tuple[Floats, Floats]:
    """Return de Casteljau's algorithm as matrices, (degree + 1, degree + 1), from the Bernstein coefficients
    on an interval to those on its lower and its upper half."""
    low = np.array([[comb(i, j) / 2**i for j in range(degree + 1)] for i in range(degree + 1)])
    return low, low[::-1, ::-1]


def greville_abscissae(knots: Floats, degree: int) -> Floats:
    """Return g_i = (t_(i+1) + ... + t_(i+p)) / p of rows of knots, (..., n + p + 1) -> (..., n).

    Each is an offset from its first knot: equal knots give that knot exactly.
    """
    n = knots.shape[-1] - degree - 1
    first = knots[..., 1 : n + 1]
    return first + sum(knots[..., k : k + n] - first for k in range(1, degree + 1)) / degree
