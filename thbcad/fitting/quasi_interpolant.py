"""Hierarchical quasi-interpolation: a local projector onto a THB space.

The coefficient of an active function of level l is the coefficient that a tensor-product
projector of that level gives, with samples on leaf cells of the level only.  There the space is a
space of level-l splines and a coefficient of the truncated basis is one of the level's own
B-spline basis, so that every spline of the space is reproduced.

In one direction a functional belongs to an interval [a, b] of whole spans inside the support of
its B-spline N_i.  It interpolates at the Greville points x_k of the knots clamped to [a, b]:

    lambda_i(f) = sum_k w_k f(x_k)   with   sum_k w_k N_j(x_k) = delta_ij,   |lambda_i| = sum_k |w_k|.

Of all rectangles of leaf cells in the support, a function takes the one of least norm: the more
cells, the smaller the norm (at degree 10, 198 for a whole support and 10^8 or more for one span).

Source: H. Speleers, C. Manni, Effortless quasi-interpolation in hierarchical spaces,
Numer. Math. 132 (2016); T. Lyche and K. Moerken, Spline Methods, chapter 8.
"""

import numpy as np
from scipy.sparse import csr_array

from thbcad.checks import Floats, Integers, require_type
from thbcad.hierarchy import GREATEST_NORM, DyadicAxis, THBSpace, best_functionals, intervals
from thbcad.splines import Function, blossom, evaluate, greville_abscissae
from thbcad.surfaces import THBSurface


def quasi_interpolate(space: THBSpace, function: Function) -> THBSurface:
    """Return the hierarchical quasi-interpolant of a function: equal to it if it lies in the space.

    A coefficient has a rounding error of about 1e-16 times the norm of its functional: where a function keeps
    only one leaf cell of its own level, 3e3 for degree 3 and 5e8 for degree 5 (uniform knots).  From degree 7
    on, `least_squares` is the more accurate.

    function : called with u and v, (n,) float each; returns (n,) or (n, d)

    Raises ValueError : values of another shape, or not finite; a functional with a norm above 1e12.
    """
    require_type("space", space, THBSpace)
    u, v, operator = quasi_interpolation(space)
    return THBSurface(space, operator @ evaluate(function, u, v))


def quasi_interpolation(space: THBSpace) -> tuple[Floats, Floats, csr_array]:
    """Return (u, v, Q): the coefficients of the quasi-interpolant of f are Q @ f(u, v).

    u, v : (n,) float, sample points.  Q : csr_array (dim, n); the sum of |Q| over row f is the
    norm of the functional of function f.  If A is ``space.collocation(u, v)``, Q @ A == identity.

    Raises ValueError : a norm above 1e12.
    """
    parts = [_level_functionals(space, level) for level in range(space.levels)]
    u, weights_u, v, weights_v = (np.concatenate(columns) for columns in zip(*parts))
    used = (weights_u != 0)[:, :, None] & (weights_v != 0)[:, None, :]
    sample_u, sample_v = (np.broadcast_to(x, used.shape)[used] for x in (u[:, :, None], v[:, None, :]))
    weights = (weights_u[:, :, None] * weights_v[:, None, :])[used]
    ends = np.r_[0, np.cumsum(used.sum(axis=(1, 2)))]
    return (
        sample_u,
        sample_v,
        csr_array((weights, np.arange(len(weights)), ends), shape=(space.dim, len(weights))),
    )


def _level_functionals(space: THBSpace, level: int) -> list[Floats]:
    """Return points and weights in u, points and weights in v of the active functions of a level, (n, 2 p +
    1) each."""
    functions = space.functions[space.functions[:, 0] == level, 1:]
    norms, (by_u, by_v) = best_functionals(space.hierarchy[level], functions, _axis_functionals)
    if (norm := float(norms.max(initial=0.0))) > GREATEST_NORM:
        raise ValueError(
            f"a functional of level {level} has the norm {norm:.2g}, which leaves fewer than four digits of "
            "float64; use least_squares"
        )
    return [*by_u, *by_v]


def _axis_functionals(axis: DyadicAxis, level: int, index: Integers) -> tuple[Floats, Floats, Floats]:
    """Return the functionals of the B-splines `index`, (n,) int, of a level on all m = (p + 1)(p + 2) / 2
    intervals of up to p + 1 spans.

    Their norms, (n, m), inf where the support has no such interval; points and weights, (n, m, 2 p + 1) each,
    zero beyond the points in use.
    """
    p = axis.degree
    head, tail = axis.support(level, index)
    start, stop = intervals(p + 1).T
    owner, interval = np.nonzero(stop <= (tail - head)[:, None])
    # indices of the last knots at the starts of the first and of the last span
    first = axis.acting(level, head[owner] + start[interval]) + p
    last = axis.acting(level, head[owner] + stop[interval] - 1) + p
    norms = np.full((len(index), len(start)), np.inf)
    points, weights = np.zeros((2, len(index), len(start), 2 * p + 1))
    for size in np.unique(last - first) + p + 1:
        here = last - first + p + 1 == size
        at = owner[here], interval[here]
        x, w = _functionals(
            axis.knots(level, first[here, None] + np.arange(-p, size + 1)), p, index[at[0]] - first[here] + p
        )
        points[*at, :size], weights[*at, :size], norms[at] = x, w, abs(w).sum(axis=1)
    return norms, points, weights


def _functionals(knots: Floats, p: int, target: Integers) -> tuple[Floats, Floats]:
    """Return points and weights, (n, m) each, on [t_p, t_m] for rows of m + p + 1 knots; `target` numbers the
    m B-splines of a row."""
    n, m = len(knots), knots.shape[1] - p - 1
    rows = np.arange(n)[:, None]
    clamped = np.clip(knots, knots[:, p : p + 1], knots[:, m : m + 1])
    points = greville_abscissae(clamped, p)
    span = np.minimum((knots[:, None, :] <= points[:, :, None]).sum(axis=2) - 1, m - 1)
    near = np.stack([knots[rows, span + offset].ravel() for offset in range(1 - p, p + 1)])
    values = blossom(near, np.broadcast_to(points.reshape(-1, 1), (n * m, p)))
    matrix = np.zeros((n, m, m))  # [row, B-spline, point]
    matrix[rows[:, :, None], span[:, :, None] - p + np.arange(p + 1), np.arange(m)[:, None]] = values.reshape(
        n, m, p + 1
    )
    unit = np.zeros((n, m, 1))
    unit[np.arange(n), target] = 1
    return points, np.linalg.solve(matrix, unit)[:, :, 0]
