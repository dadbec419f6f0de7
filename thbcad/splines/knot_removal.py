"""Knot removal: the same spline with fewer knots, within a certified tolerance.

Let P be the refinement matrix from the knots that stay to the knots there were.  The coefficients
d on the fewer knots minimise |c - P d| (least squares), and since B-splines are non-negative and
sum to one,

    |s(u) - s~(u)| <= max_i |c - P d|_i    for every u.

Source: T. Lyche and K. Moerken, Knot removal for parametric B-spline curves and surfaces, CAGD 4
(1987); A data-reduction strategy for splines, IMA J. Numer. Anal. 8 (1988).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import Floats, floats, read_only, require_number, require_type
from thbcad.splines.bspline_surface import BSplineSurface
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.sparse_operators import banded_least_squares, tensor_apply

# nets are (n, m, d): n coefficients along the knots, m across them, d components
Net = Floats


@dataclass(frozen=True, eq=False)
class Removal:
    """A curve on fewer knots: |s(u) - s~(u)| <= bound for all u, but for rounding.

    kv : the knots that stay; coefficients : (kv.dim,) or (kv.dim, d); bound : Euclidean norm over d.
    """

    kv: KnotVector
    coefficients: Floats
    bound: float


@dataclass(frozen=True, eq=False)
class SurfaceRemoval:
    """A surface on fewer knots: |S(u, v) - S~(u, v)| <= bound for all (u, v), but for rounding."""

    surface: BSplineSurface
    bound: float


@dataclass(frozen=True, eq=False)
class _Fit:
    """Least squares on fewer knots: net (kv.dim, m, d), bound of its error."""

    kv: KnotVector
    net: Net
    bound: float


def remove_knots(kv: KnotVector, coefficients: ArrayLike, tolerance: float) -> Removal:
    """Return a curve on as few of its knots as the search finds, with bound = max_i |c - P d|_i <= tolerance.

    No single knot more can go: least squares without it has a greater bound than the tolerance.

    kv : clamped knots; coefficients : (dim,) or (dim, d); tolerance : in units of the coefficients.

    Raises
    ------
    ValueError : coefficients of another shape or not finite; tolerance that is negative or NaN.
    """
    require_type("kv", kv, KnotVector)
    require_number("tolerance", tolerance, least=0)
    c = floats(coefficients)
    if c.shape[:1] != (kv.dim,) or c.ndim > 2:
        raise ValueError(f"coefficients must have shape ({kv.dim},) or ({kv.dim}, d), got {c.shape}")
    if not np.isfinite(c).all():
        raise ValueError("coefficients must be finite")
    scale = _power_of_two(c)
    fit = _thinned(kv, c.reshape(kv.dim, 1, -1) / scale, tolerance / scale)
    return Removal(fit.kv, read_only(scale * fit.net.reshape(fit.kv.dim, *c.shape[1:])), scale * fit.bound)


def remove_surface_knots(surface: BSplineSurface, tolerance: float) -> SurfaceRemoval:
    """Return a surface on as few of its knots as the search finds, with bound = max_ij |C - P_u D P_v^T|_ij
    <= tolerance.

    Removal in u uses up to half of the tolerance, removal in v what is left.

    Raises
    ------
    ValueError : tolerance that is negative or NaN.
    """
    require_type("surface", surface, BSplineSurface)
    require_number("tolerance", tolerance, least=0)
    kv_u, kv_v = surface.kv_u, surface.kv_v
    scale = _power_of_two(surface.coefficients)
    net = surface.coefficients.reshape(kv_u.dim, kv_v.dim, -1) / scale
    tolerance = tolerance / scale
    by_u = _thinned(kv_u, net, tolerance / 2)
    by_v = _thinned(kv_v, _turned(by_u.net), tolerance - by_u.bound)
    fitted = _turned(by_v.net)
    near = tensor_apply(by_u.kv.prolongation(kv_u), by_v.kv.prolongation(kv_v), fitted)
    shape = by_u.kv.dim, by_v.kv.dim, *surface.coefficients.shape[2:]
    bound = min(_distance(net, near), by_u.bound + by_v.bound)
    return SurfaceRemoval(BSplineSurface(by_u.kv, by_v.kv, scale * fitted.reshape(shape)), scale * bound)


def removal_errors(kv: KnotVector, coefficients: Floats) -> Floats:
    """Return for each interior break the least max_i |c - P d|_i over all d, one copy of it removed, (spans -
    1,).

    P of one inserted knot z has two bidiagonal entries a_i, 1 - a_i per row, and one vector y with y P = 0:

        a_i = (z - t_i) / (t_(i+p+1) - t_i),   y_(i+1) (1 - a_(i+1)) = -y_i a_i;   error = |y c| / sum_i
        |y_i|.

    coefficients : (dim,) or (dim, d); Euclidean norm over d.
    """
    scale = _power_of_two(coefficients)
    return scale * _defects(kv, coefficients.reshape(kv.dim, 1, -1) / scale)[:, 0]


def _defects(kv: KnotVector, net: Net) -> Floats:
    """Return the `removal_errors` of every column of the net, (spans - 1, m)."""
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
        errors = _defects(best.kv, best.net).max(axis=1)
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
        errors = _defects(best.kv, best.net)
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
    return _Fit(coarser, d.reshape(-1, *net.shape[1:]), _distance(net, (p @ d).reshape(net.shape)))


def _turned(net: Net) -> Net:
    return np.ascontiguousarray(net.transpose(1, 0, 2))


def _distance(net: Net, other: Net) -> float:
    return float(np.linalg.norm(net - other, axis=2).max())


def _power_of_two(net: Floats) -> float:
    """Return the power of two that makes the greatest size 1 to 2: squares of the scaled net keep its
    digits."""
    return float(np.ldexp(1.0, np.frexp(abs(net).max())[1] - 1))
