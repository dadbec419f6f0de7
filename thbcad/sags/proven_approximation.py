"""Splines that follow a function of two variables, with a proven bound of the error.

Let s be a spline of degrees (p, q), e = f - s, and L_x, L_y interpolation at the p + 1 (q + 1)
Chebyshev extrema of a cell, with Lebesgue constants Lambda_p, Lambda_q.  On the cell the derivatives
of order p + 1 in x and q + 1 in y of e are those of f, hence

    |e| <= |e - L_x e| + |L_x (e - L_y e)| + |L_x L_y e|
        <= r_x + Lambda_p r_y + Lambda_p Lambda_q max_k |e(node_k)|,
    r_x = 4 (h_x / 4)^(p+1) / (p + 1)! max |d^(p+1) f / dx^(p+1)|,     r_y likewise:

bounds of two derivatives and finitely many values prove the error everywhere.

Source: T. J. Rivlin, Chebyshev Polynomials, chapter 1; J. H. McCabe and G. M. Phillips, On a certain
class of Lebesgue constants, BIT 13 (1973).
"""

from dataclasses import dataclass
from math import factorial
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from thbcad.checks import EPS, Bools, Floats, require_number, require_type
from thbcad.splines import BSplineSurface, KnotVector, interpolate

MOST_CONTROL_POINTS = 2000  # per direction
BLOCK = 1 << 18  # values at a time


@runtime_checkable
class BoundedFunction(Protocol):
    """A function f(x, y), mm, with bounds of its derivatives and of its rounding errors; `str` of it names it
    in messages."""

    def grid(self, x: Floats, y: Floats) -> Floats:
        """Return the values on the grid x x y, (len(x), len(y))."""
        ...

    def derivative_bound(self, order: int, axis: int, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return bounds of |d^order f| along an axis on the cells between the breaks x and y, (len(x) - 1,
        len(y) - 1)."""
        ...

    def rounding(self, x: ArrayLike, y: ArrayLike) -> float:
        """Return a bound of the rounding errors of `grid` on the rectangle that the rows x and y span."""
        ...


@dataclass(frozen=True)
class Approximation:
    """A spline and a proven bound of its greatest distance in z from the function, mm.

    >>> kv = KnotVector.uniform(degree=3, spans=2, start=-4.0, stop=4.0)
    >>> found = approximated(Conic(20.0), kv, kv, tolerance=1e-6)
    >>> off = found.surface(3.0, 1.0) - Conic(20.0)(3.0, 1.0)
    >>> found.bound <= 1e-6, float(abs(off)) <= found.bound
    (True, True)
    """

    surface: BSplineSurface
    bound: float


@dataclass(frozen=True, eq=False)
class CellBounds:
    """Proven bounds of |f - s| on every cell, (spans_u, spans_v), mm, and their parts r_x and r_y of the same
    shape.

    rounding : float, the part of `total` that stands for rounding errors.
    """

    total: Floats
    remainder_x: Floats
    remainder_y: Floats
    rounding: float


def lebesgue_bound(degree: int) -> float:
    """Return a bound of the Lebesgue constant of interpolation at the `lobatto_nodes`, equal to it for odd
    degrees.

    Lambda_p <= 1/p sum_(k=0..p-1) cot((2k + 1) pi / (4 p)).
    """
    return float(np.sum(1 / np.tan((2 * np.arange(degree) + 1) * np.pi / (4 * degree))) / degree)


def lobatto_nodes(breaks: ArrayLike, degree: int) -> Floats:
    """Return the extrema of the Chebyshev polynomial of a degree on every interval, (intervals degree + 1,),
    increasing.

    Neighbours share the break between them.
    """
    b = np.asarray(breaks, dtype=np.float64)
    nodes = np.sin(np.arange(degree) * np.pi / (2 * degree)) ** 2
    return np.append((b[:-1, None] + np.diff(b)[:, None] * nodes).ravel(), b[-1])


def cell_maxima(values: Floats, degrees: tuple[int, int]) -> Floats:
    """Return the greatest size among the values at the nodes of every cell; values are (cells_x p + 1,
    cells_y q + 1)."""
    sizes = abs(values)
    for p in degrees:
        inner = sizes[:-1].reshape(-1, p, sizes.shape[1]).max(axis=1)
        sizes = np.maximum(inner, sizes[p::p]).T
    return sizes


def node_slack(breaks: ArrayLike, degree: int) -> Floats:
    """Return for every interval the factor that covers the rounding of its nodes, (intervals,).

    Nodes moved by delta half-widths raise r and Lambda by a factor below 1 + 2 (p + 1)^3 delta
    (Markov's inequality); delta is at most 4 EPS max|x| over the width of the interval.
    """
    b = np.asarray(breaks, dtype=np.float64)
    result: Floats = 1 + 8 * (degree + 1) ** 3 * EPS * abs(b).max() / np.diff(b)
    return result


def error_bounds(function: BoundedFunction, surface: BSplineSurface) -> CellBounds:
    """Return proven bounds of |f - s| on every cell of a scalar surface, rounding errors included.

    Raises ValueError : another kind of function or surface, as a THBSurface without `to_bspline`.
    """
    require_type("function", function, BoundedFunction)
    require_type("surface", surface, BSplineSurface)
    kv_x, kv_y = surface.kv_u, surface.kv_v
    p, q = kv_x.degree, kv_y.degree
    remainder_x = _remainder(kv_x)[:, None] * function.derivative_bound(p + 1, 0, kv_x.breaks, kv_y.breaks)
    remainder_y = _remainder(kv_y)[None, :] * function.derivative_bound(q + 1, 1, kv_x.breaks, kv_y.breaks)
    # values of the spline: 5 p roundings in a basis function and p + 1 in the sum, in x and in y
    rounding = (
        function.rounding(kv_x.breaks, kv_y.breaks)
        + (3 * (p + q) + 1) * EPS * abs(surface.coefficients).max()
    )
    slack = node_slack(kv_x.breaks, p)[:, None] * node_slack(kv_y.breaks, q)[None, :]
    growth = lebesgue_bound(p) * lebesgue_bound(q)
    total = (
        remainder_x
        + lebesgue_bound(p) * remainder_y
        + growth * (_greatest_at_nodes(function, surface) + rounding)
    )
    return CellBounds(slack * total, remainder_x, remainder_y, float(growth * rounding))


def approximated(
    function: BoundedFunction,
    kv_x: KnotVector,
    kv_y: KnotVector,
    tolerance: float,
    most: int = MOST_CONTROL_POINTS,
) -> Approximation:
    """Return a spline whose distance from the function is proven to be at most `tolerance`, mm.

    It interpolates at the Greville abscissae; spans are bisected until the bound holds.  The knots of
    `kv_x` and `kv_y` stay.

    most : control points per direction.

    Raises ValueError : a tolerance that is not positive, that rounding errors do not allow to prove, or that
        needs more control points than that; a function without finite bounds.
    """
    require_type("function", function, BoundedFunction)
    require_number("tolerance", tolerance, above=0)
    while True:
        surface = interpolate(kv_x, kv_y, function.grid(kv_x.greville(), kv_y.greville()))
        bounds = error_bounds(function, surface)
        bound = float(bounds.total.max())
        if bound <= tolerance:
            return Approximation(surface, bound)
        _require_provable(function, bounds, tolerance)
        finer = _graded(function, kv_x, kv_y, tolerance, most)
        if (finer[0].dim, finer[1].dim) == (kv_x.dim, kv_y.dim):
            finer = _bisected_where_failing(bounds, kv_x, kv_y, tolerance)
        kv_x, kv_y = finer
        if max(kv_x.dim, kv_y.dim) > most:
            raise ValueError(
                f"{function} cannot be written as a spline to {tolerance:g} mm with {most} "
                "control points per direction; "
                "use a higher degree or a larger tolerance"
            )


def _require_provable(function: BoundedFunction, bounds: CellBounds, tolerance: float) -> None:
    if not np.isfinite(bounds.total).all():
        raise ValueError(f"{function} has no finite bounds on the whole rectangle")
    if 2 * bounds.rounding > tolerance:
        raise ValueError(
            f"{tolerance:g} mm cannot be proven for {function}: "
            f"rounding errors may reach {bounds.rounding:.2g} mm; ask for more than twice that"
        )


def _greatest_at_nodes(function: BoundedFunction, surface: BSplineSurface) -> Floats:
    """Return max_k |e(node_k)| of every cell, (spans_u, spans_v), a few rows of cells at a time."""
    p, q = surface.kv_u.degree, surface.kv_v.degree
    y = lobatto_nodes(surface.kv_v.breaks, q)
    step = -(-BLOCK // (p * len(y)))
    out = []
    for first in range(0, surface.kv_u.spans, step):
        x = lobatto_nodes(surface.kv_u.breaks[first : first + step + 1], p)
        out.append(cell_maxima(function.grid(x, y) - surface.grid(x, y), (p, q)))
    return np.concatenate(out)


def _graded(
    function: BoundedFunction, kv_x: KnotVector, kv_y: KnotVector, tolerance: float, most: int
) -> tuple[KnotVector, KnotVector]:
    """Return the knot vectors with spans bisected until the expected error at the nodes takes half the
    tolerance in each direction."""
    growth = lebesgue_bound(kv_x.degree) * lebesgue_bound(kv_y.degree)
    finer = []
    for axis, kv in enumerate((kv_x, kv_y)):
        n = kv.degree + 1
        large = np.ones(1, dtype=bool)
        while large.any() and kv.dim <= most:
            cells = (kv.breaks, kv_y.breaks[[0, -1]]) if axis == 0 else (kv_x.breaks[[0, -1]], kv.breaks)
            steepest = function.derivative_bound(n, axis, *cells).ravel()
            large = growth * _expected_share(kv) * _remainder(kv) * steepest > tolerance / 2
            kv = _bisected(kv, large)
        finer.append(kv)
    return finer[0], finer[1]


def _bisected_where_failing(
    bounds: CellBounds, kv_x: KnotVector, kv_y: KnotVector, tolerance: float
) -> tuple[KnotVector, KnotVector]:
    """Return the knot vectors with the spans of the failing cells bisected in x, y or both: where more than a
    third is expected."""
    failing = bounds.total > tolerance
    in_x, in_y = bounds.remainder_x * _expected_share(kv_x), bounds.remainder_y * _expected_share(kv_y)
    return (
        _bisected(kv_x, np.any(failing & (2 * in_x >= in_y), axis=1)),
        _bisected(kv_y, np.any(failing & (2 * in_y >= in_x), axis=0)),
    )


def _bisected(kv: KnotVector, spans: Bools) -> KnotVector:
    b = kv.breaks
    return kv.insert((b[:-1] + np.diff(b) / 2)[spans])


def _remainder(kv: KnotVector) -> Floats:
    """Return 4 (h / 4)^(p+1) / (p + 1)! of every span, (spans,)."""
    n = kv.degree + 1
    return 4 * (np.diff(kv.breaks) / 4) ** n / factorial(n)


def _expected_share(kv: KnotVector) -> float:
    """Return how many times the remainder r spline interpolation is expected to err.

    On equal spans the error is f^(n) h^n / n! times the Bernoulli polynomial of degree n = p + 1, of size 2
    (h / (2 pi))^n.
    """
    n = kv.degree + 1
    return 0.5 * (2 / np.pi) ** n * factorial(n)
