"""Knot removal: the same spline with fewer knots, within a certified tolerance.

Let P be the refinement matrix from the knots that stay to the knots there were.  The coefficients
d on the fewer knots minimise |c - P d| (least squares), and since B-splines are non-negative and
sum to one,

    |s(u) - s~(u)| <= max_i |c - P d|_i    for every u.

Source: T. Lyche and K. Moerken, Knot removal for parametric B-spline curves and surfaces, CAGD 4
(1987); A data-reduction strategy for splines, IMA J. Numer. Anal. 8 (1988).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thbcad.checks import Floats
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.sparse_operators import banded_least_squares

# nets are (n, m, d): n coefficients along the knots, m across them, d components
Net = Floats


@dataclass(frozen=True, eq=False)
class _Fit:
    """Least squares on fewer knots: net (kv.dim, m, d), bound of its error."""

    kv: KnotVector
    net: Net
    bound: float


def thinned(
    knot_vectors: Sequence[KnotVector], net: Floats, tolerance: float
) -> tuple[list[KnotVector], Floats]:
    """Return the knots and the net D of a spline on as few of its knots as the search finds, with
    max |C - P_u D P_v^T| <= tolerance.

    Of a surface, removal in u uses up to half of the tolerance, removal in v what is left.  Of a curve, no
    single knot more can go: least squares without it has a greater bound than the tolerance.

    net : (n_u[, n_v][, d]), one direction for each knot vector
    """
    count = len(knot_vectors)
    # the power of two that makes the greatest size 1 to 2: squares of the scaled net keep its digits
    scale = float(np.ldexp(1.0, np.frexp(abs(net).max())[1] - 1))
    table = net.reshape(len(net), -1, int(np.prod(net.shape[count:]))) / scale
    left = tolerance / scale
    vectors: list[KnotVector] = []
    for kv in knot_vectors:
        fit = _thinned(kv, table, left / (count - len(vectors)))
        vectors.append(fit.kv)
        left -= fit.bound
        table = np.ascontiguousarray(fit.net.transpose(1, 0, 2))
    return vectors, scale * table.reshape(*(kv.dim for kv in vectors), *net.shape[count:])


def removal_errors(kv: KnotVector, net: Net) -> Floats:
    """Return for each interior break the least max_i |c - P d|_i over all d, one copy of it removed, of every
    column c of the net, (spans - 1, m); Euclidean norm over its components.

    P of one inserted knot z has two bidiagonal entries a_i, 1 - a_i per row, and one vector y with y P = 0:

        a_i = (z - t_i) / (t_(i+p+1) - t_i),   y_(i+1) (1 - a_(i+1)) = -y_i a_i;   error = |y c| / sum_i
        |y_i|.
    """
    p, t = kv.degree, kv.knots
    last = np.searchsorted(t, kv.breaks[1:-1], "right") - 1
    rows = last[:, None] + np.arange(-p - 1, 1)
    a = (t[last][:, None] - t[rows]) / (t[rows + p + 1] - t[rows])
    y = np.cumprod(np.column_stack([np.ones(len(a)), -a[:, :-1] / (1 - a[:, 1:])]), axis=1)
    y /= np.abs(y).sum(axis=1, keepdims=True)
    result: Floats = np.linalg.norm(sum(y[:, k, None, None] * net[rows[:, k]] for k in range(p + 2)), axis=2)
    return result


def _thinned(kv: KnotVector, net: Net, tolerance: float) -> _Fit:
    """Return the fit on the fewest knots.

    Every second break, least error first: as many as go, found by bisection; in turn with the
    breaks between, until neither half loses a knot.  Neighbours stay, so that the errors of
    those that leave hardly add up.  Then all breaks one by one, until none goes.
    """
    best = _Fit(kv, net, 0.0)
    phase = 0
    idle = 0
    while idle < 2:
        errors = removal_errors(best.kv, best.net).max(axis=1)
        half = np.arange(phase, best.kv.spans - 1, 2)
        order = best.kv.breaks[1:-1][half[np.argsort(errors[half], kind="stable")]]
        fewer = _most(kv, net, tolerance, best, order)
        idle = idle + 1 if fewer is best else 0
        best = fewer
        phase = 1 - phase
    return _swept(kv, net, tolerance, best)


def _most(kv: KnotVector, net: Net, tolerance: float, best: _Fit, order: Floats) -> _Fit:
    """Return the fit without one copy of the first k breaks of `order`, for the greatest k that bisection
    finds."""
    start = best.kv
    low = 0
    high = len(order) + 1
    while high - low > 1:
        k = (low + high) // 2
        fit = _fit(kv, net, start, order[:k])
        if fit.bound <= tolerance:
            low = k
            best = fit
        else:
            high = k
    return best


def _swept(kv: KnotVector, net: Net, tolerance: float, best: _Fit) -> _Fit:
    """Return the fit after passes over all breaks, each tried alone, until a pass removes none.

    The worst column of the net is tried first: most breaks fail there already.
    """
    before = None
    while best is not before:
        before = best
        errors = removal_errors(best.kv, best.net)
        for k in np.argsort(errors.max(axis=1), kind="stable"):
            z = before.kv.breaks[k + 1 : k + 2]
            worst = net[:, [errors[k].argmax()]]
            if _fit(kv, worst, best.kv, z).bound <= tolerance:
                fit = _fit(kv, net, best.kv, z)
                best = fit if fit.bound <= tolerance else best
    return best


def _fit(kv: KnotVector, net: Net, kept: KnotVector, breaks: Floats) -> _Fit:
    """Return the least-squares fit to the net over `kv` on the knots `kept` without one copy of each of the
    breaks."""
    coarser = KnotVector(kv.degree, np.delete(kept.knots, np.searchsorted(kept.knots, breaks, "right") - 1))
    p = coarser.prolongation(kv)
    d = banded_least_squares(p, kv.degree, net.reshape(kv.dim, -1))
    off = np.linalg.norm(net - (p @ d).reshape(net.shape), axis=2).max()
    return _Fit(coarser, d.reshape(-1, *net.shape[1:]), float(off))
