"""Certified bounds of a graph z(x, y) and its derivatives from Bernstein coefficients.

On a cell a vector of polynomials is a convex combination of its Bernstein coefficients.  A convex
function of the vector is therefore nowhere greater than its greatest value at the coefficients,
and at the four corners it takes its value there.  Both bounds meet with the square of the cell
size: branch and bound drops the cells that cannot hold the greatest value and quarters the others.

The bounds hold in floating point.  Derivatives are differences of the spline coefficients as they
are given; all that follows takes means with non-negative weights.  The error of n roundings is then
at most n 2^-53 times the greatest coefficient; the allowance takes 2^-52, which also covers the
rounding of the allowance itself.

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 14; N. Higham, Accuracy and
Stability of Numerical Algorithms, chapter 3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from thbcad.bspline import KnotVector
from thbcad.checks import EPS, require_order
from thbcad.operators import band_matrix, tensor_apply
from thbcad.polar import bezier_rows
from thbcad.surface import BSplineSurface
from thbcad.thb import THBSurface

MOST_COEFFICIENTS = 2**25  # 256 MiB; about a second of work
MOST_STEPS = 50  # then a cell is as small as the spacing of the numbers
STRIP = 4096  # cells that are assessed at once, so that their arrays fit in the cache
GREATEST = 1e40  # products of seven such numbers are finite
TINY = float(np.finfo(np.float64).tiny)  # above every error of a subnormal result

Array = NDArray[np.float64]
Graph = BSplineSurface | THBSurface | Sequence[BSplineSurface]
Orders = tuple[int, int]


@dataclass(frozen=True)
class Enclosure:
    """lower <= true extreme value <= upper; `value` is the best value found, taken at (u, v).

    Where a derivative jumps, `value` is that of one of the cells that meet at (u, v).
    """

    lower: float
    upper: float
    value: float
    u: float
    v: float


@dataclass(frozen=True, eq=False)
class Cells:
    """Vectors of d polynomials on n cells, by their Bernstein coefficients of degree (p, q).

    coefficients : (d, p + 1, q + 1, n) float
    box : (2, 2, n) float, box[0] = (u, v) of the lower left corners, box[1] of the upper right ones
    magnitude : (d,) float, no coefficient is greater
    error : (d,) float, bounds of the rounding errors of the coefficients
    """

    coefficients: Array
    box: Array
    magnitude: Array
    error: Array

    def negated(self) -> Cells:
        """Return the negative polynomials."""
        return replace(self, coefficients=-self.coefficients)

    def take(self, chosen: NDArray[np.bool_]) -> Cells:
        """Return the chosen cells; chosen : (n,) bool."""
        return replace(self, coefficients=self.coefficients[..., chosen], box=self.box[..., chosen])

    def quartered(self) -> Cells:
        """Return the four quarters of every cell, by de Casteljau's algorithm written as a matrix."""
        cells = self
        for axis in (0, 1):
            degree = cells.coefficients.shape[axis + 1] - 1
            half = np.array([[comb(i, j) / 2**i for j in range(degree + 1)] for i in range(degree + 1)])
            halves = [_along(axis + 1, matrix, cells.coefficients) for matrix in (half, half[::-1, ::-1])]
            low, high = cells.box.copy(), cells.box.copy()
            low[1, axis] = high[0, axis] = cells.box[0, axis] + (cells.box[1, axis] - cells.box[0, axis]) / 2
            error = cells.error + rounding(degree + 1, cells.magnitude)
            cells = replace(cells, coefficients=np.concatenate(halves, -1), box=np.concatenate([low, high], -1), error=error)
        return cells


@dataclass(frozen=True, eq=False)
class Assessment:
    """What is known of a function on n cells.

    corners : (4, n) float, values at the corners (0, 0), (0, 1), (1, 0), (1, 1)
    error : float, the rounding error of these values is at most this
    upper : (n,) float, the function is at most this on the cells, rounding included
    scale : float, what a relative tolerance refers to
    """

    corners: Array
    error: float
    upper: Array
    scale: float


def minimum(graph: Graph, derivative: Orders = (0, 0), tolerance: float = 1e-9) -> Enclosure:
    """Return certified bounds of the least value of d^(a+b) z / dx^a dy^b.

    graph : a scalar BSplineSurface or THBSurface, or patches of one surface
    derivative : (a, b)

    The search ends when the bounds differ by `tolerance` times the greatest coefficient.  Where
    the least value is taken along a whole curve it can end earlier, with wider bounds that hold too.

    Raises
    ------
    ValueError : a graph that is not scalar, a negative order, derivatives above 1e40.
    """
    return _negative(greatest((cells.negated() for cells in bernstein(graph, (derivative,))), _value, tolerance))


def value_range(graph: Graph, derivative: Orders = (0, 0), tolerance: float = 1e-9) -> tuple[Enclosure, Enclosure]:
    """Return certified bounds of the least and of the greatest value of d^(a+b) z / dx^a dy^b.

    The search ends as in `minimum`.  A derivative that jumps at a knot counts with both its values.

    Raises
    ------
    ValueError : a graph that is not scalar, a negative order, derivatives above 1e40.
    """
    return minimum(graph, derivative, tolerance), greatest(bernstein(graph, (derivative,)), _value, tolerance)


def greatest(pieces: Iterable[Cells], assess: Callable[[Cells, float], Assessment], tolerance: float) -> Enclosure:
    """Return bounds of the greatest value of a function of the vectors, by branch and bound.

    assess : (cells, best value so far) -> Assessment

    The bounds differ by at most tolerance * scale and some rounding, unless that needs more than
    2^25 coefficients besides those given.
    """
    best, closed, work = (-np.inf, -np.inf, 0.0, 0.0), -np.inf, 0
    for _ in range(MOST_STEPS):
        kept, least = [], -np.inf
        for cells in pieces:
            found = assess(cells, best[0])
            best = max(best, _best_corner(cells, found))
            least = max(least, best[0] + tolerance * found.scale + 2 * found.error)
            chosen = found.upper > least
            closed = max(closed, float(found.upper[~chosen].max(initial=-np.inf)))
            kept.append((cells.take(chosen), found.upper[chosen]))
        cells, upper = _joined([cells for cells, _ in kept]), np.concatenate([upper for _, upper in kept])
        chosen = upper > least
        closed = max(closed, float(upper[~chosen].max(initial=-np.inf)))
        cells, upper = cells.take(chosen), upper[chosen]
        work += 4 * cells.coefficients.size
        if not len(upper) or work > MOST_COEFFICIENTS:
            break
        pieces = [cells.quartered()]
    value, lower, u, v = best
    return Enclosure(lower, max(closed, float(upper.max(initial=value))), value, u, v)


def bernstein(graph: Graph, derivatives: tuple[Orders, ...]) -> Iterator[Cells]:
    """Yield the partial derivatives of a scalar graph on all its cells, elevated to one degree, strip by strip.

    Raises
    ------
    ValueError : no patch, patches of different degrees, a graph that is not scalar, a negative
        order, derivatives above 1e40.
    """
    patches, error = _patches(graph)
    for order in (order for orders in derivatives for order in orders):
        require_order(order)
    rows = [[_differentiated(patch, orders, error) for orders in derivatives] for patch in patches]
    magnitude = np.max([[np.abs(net).max() for net, _ in row] for row in rows], axis=0)
    if not (magnitude < GREATEST).all():
        most = np.nan_to_num(magnitude, nan=np.inf).max()
        raise ValueError(f"bounds need derivatives {derivatives} with coefficients below {GREATEST:g}, got {most:.3g}")
    by_axis = tuple(zip(*derivatives))
    p, q = (max(kv.degree - min(orders), 0) for kv, orders in zip((patches[0].kv_u, patches[0].kv_v), by_axis))
    error = np.max([[e for _, e in row] for row in rows], axis=0) + rounding(_roundings(p, q), magnitude)
    extraction = cache(_extraction)
    for patch, row in zip(patches, rows):
        nets = [net for net, _ in row]
        a = [extraction(patch.kv_u, order, p) for order in by_axis[0]]
        b = [extraction(patch.kv_v, order, q) for order in by_axis[1]]
        step = max(1, STRIP // patch.kv_v.spans)
        for first in range(0, patch.kv_u.spans, step):
            tables = [tensor_apply(x[first * (p + 1) : (first + step) * (p + 1)], y, net) for x, y, net in zip(a, b, nets)]
            coefficients = np.stack(tables).reshape(len(nets), -1, p + 1, patch.kv_v.spans, q + 1).transpose(0, 2, 4, 1, 3)
            yield Cells(coefficients.reshape(len(nets), p + 1, q + 1, -1), _boxes(patch, first, step), magnitude, error)


def rounding(count: int, size: Array | float) -> Array | float:
    """Return the allowance for a count of roundings of numbers of this size."""
    return count * (EPS * size + TINY * (size > 0))


def corners(values: Array) -> Array:
    """Return the corners (0, 0), (0, 1), (1, 0), (1, 1) of coefficients (..., p + 1, q + 1, n), as (..., 4, n)."""
    return values[..., [0, 0, -1, -1], [0, -1, 0, -1], :]


def _value(cells: Cells, best: float) -> Assessment:
    values, error = cells.coefficients[0], float(cells.error[0])
    return Assessment(corners(values), error, values.max(axis=(0, 1)) + error, float(cells.magnitude[0]))


def _best_corner(cells: Cells, found: Assessment) -> tuple[float, float, float, float]:
    """Return (value, lower bound of the value, u, v)."""
    corner, k = np.unravel_index(int(np.argmax(found.corners)), found.corners.shape)
    value = float(found.corners[corner, k])
    return value, value - found.error, float(cells.box[corner // 2, 0, k]), float(cells.box[corner % 2, 1, k])


def _joined(pieces: list[Cells]) -> Cells:
    coefficients, box = (np.concatenate([getattr(cells, name) for cells in pieces], axis=-1) for name in ("coefficients", "box"))
    return replace(pieces[0], coefficients=coefficients, box=box)


def _negative(found: Enclosure) -> Enclosure:
    """Return the enclosure of the negative number; 0.0 - x is never -0.0."""
    return Enclosure(0.0 - found.upper, 0.0 - found.lower, 0.0 - found.value, found.u, found.v)


def _patches(graph: Graph) -> tuple[list[BSplineSurface], float]:
    """Return the graph as B-spline patches and the rounding error of their coefficients."""
    if isinstance(graph, THBSurface):
        # two products with polar forms for every level of the hierarchy
        count = graph.space.levels * _roundings(graph.space.kv_u.degree, graph.space.kv_v.degree)
        patches, error = [graph.to_bspline()], float(rounding(count, np.abs(graph.coefficients).max()))
    else:
        patches, error = [graph] if isinstance(graph, BSplineSurface) else list(graph), 0.0
    for patch in patches:
        if patch.coefficients.ndim != 2:
            raise ValueError(f"bounds need scalar coefficients, got a net of shape {patch.coefficients.shape}")
    degrees = {(patch.kv_u.degree, patch.kv_v.degree) for patch in patches}
    if len(degrees) != 1:
        raise ValueError(f"bounds need one or more patches of equal degrees, got degrees {sorted(degrees)}")
    return patches, error


def _boxes(patch: BSplineSurface, first: int, step: int) -> Array:
    u, v = patch.kv_u.breaks[first : first + step + 1], patch.kv_v.breaks
    ends = [np.meshgrid(*pair, indexing="ij") for pair in ((u[:-1], v[:-1]), (u[1:], v[1:]))]
    return np.reshape(ends, (2, 2, -1))


def _differentiated(patch: BSplineSurface, orders: Orders, error: float) -> tuple[Array, float]:
    """Return the coefficients of a derivative, c_i' = p (c_(i+1) - c_i) / (t_(i+p+1) - t_(i+1)) in u and v, and their error."""
    net = patch.coefficients
    for kv, order in zip((patch.kv_u, patch.kv_v), orders):
        if order > kv.degree:
            net, error = np.zeros_like(net), 0.0
        for done in range(order if order <= kv.degree else 0):
            p, knots = kv.degree - done, kv.knots[done + 1 : len(kv.knots) - done - 1]
            width = (knots[p:] - knots[:-p])[:, None]
            real = width > 0  # a function without support has no coefficient
            with np.errstate(over="ignore", invalid="ignore"):  # refused later
                change = np.diff(net, axis=0)
                net = np.divide(p * change, width, out=np.zeros_like(change), where=real)
                error = 2 * p * error / width[real].min() * (1 + 8 * EPS)
            error += change.any() * rounding(4, max(np.abs(net).max(), TINY))
        net = net.T
    return net, float(error)


def _extraction(kv: KnotVector, order: int, degree: int) -> csr_array:
    """Return the operator from the coefficients of a derivative to Bernstein coefficients of a degree on every span."""
    if order > kv.degree:
        return csr_array((kv.spans * (degree + 1), kv.dim))
    p, knots = kv.degree - order, kv.knots[order : len(kv.knots) - order]
    span = np.flatnonzero(np.diff(knots) > 0)
    rows = bezier_rows(knots[span + np.arange(1 - p, p + 1)[:, None]])
    return band_matrix(np.repeat(span - p, degree + 1), (_elevation(p, degree) @ rows).reshape(-1, p + 1), len(knots) - p - 1)


def _elevation(p: int, degree: int) -> Array:
    """Return the degree elevation of Bernstein coefficients, (degree + 1, p + 1)."""
    rest = degree - p
    weights = [[comb(p, j) * comb(rest, i - j) if i >= j else 0 for j in range(p + 1)] for i in range(degree + 1)]
    return np.array(weights) / [[comb(degree, i)] for i in range(degree + 1)]


def _along(axis: int, matrix: Array, block: Array) -> Array:
    """Return the product of a matrix with one axis of the coefficients."""
    return np.moveaxis(np.tensordot(matrix, block, (1, axis)), 0, axis)


def _roundings(p: int, q: int) -> int:
    """Return the roundings of two products with polar forms of degrees p, q: 5 per factor, the elevation and the sums."""
    return 8 * (p + q + 2)
