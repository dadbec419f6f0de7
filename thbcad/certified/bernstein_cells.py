"""Derivatives of a graph z(x, y) as Bernstein coefficients on its cells, with bounds of their rounding
errors.

Derivatives are differences of the spline coefficients as they are given; all that follows takes means
with non-negative weights.  The error of n roundings is then at most n 2^-53 times the greatest
coefficient; the allowance takes 2^-52, which also covers the rounding of the allowance itself.

Source: G. Farin, Curves and Surfaces for CAGD, chapters 5 and 14; N. Higham, Accuracy and
Stability of Numerical Algorithms, chapter 3.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from math import comb

import numpy as np
from scipy.sparse import csr_array

from thbcad.certified.polynomial_cells import TINY, Cells, rounding
from thbcad.checks import EPS, Floats, require_orders, require_type
from thbcad.splines import BSplineSurface, KnotVector, band_matrix, bezier_rows, tensor_apply
from thbcad.surfaces import THBSurface

STRIP = 4096  # cells that are assessed at once, so that their arrays fit in the cache
GREATEST = 1e40  # products of seven such numbers are finite

Graph = BSplineSurface | THBSurface | Sequence[BSplineSurface]
Orders = tuple[int, int]


def bernstein(graph: Graph, derivatives: tuple[Orders, ...]) -> Iterator[Cells]:
    """Yield the partial derivatives of a scalar graph on all its cells, elevated to one degree, strip by
    strip.

    Raises ValueError : no patch, patches of different degrees, a graph that is not scalar, a negative
        order, derivatives above 1e40.
    """
    patches, error = _patches(graph)
    derivatives = tuple(require_orders(orders) for orders in derivatives)
    rows = [[_differentiated(patch, orders, error) for orders in derivatives] for patch in patches]
    magnitude = np.max([[np.abs(net).max() for net, _ in row] for row in rows], axis=0)
    if not (magnitude < GREATEST).all():
        most = np.nan_to_num(magnitude, nan=np.inf).max()
        raise ValueError(
            f"bounds need derivatives {derivatives} with coefficients below {GREATEST:g}, got {most:.3g}"
        )
    by_axis = tuple(zip(*derivatives))
    p, q = (
        max(kv.degree - min(orders), 0) for kv, orders in zip((patches[0].kv_u, patches[0].kv_v), by_axis)
    )
    error = np.max([[e for _, e in row] for row in rows], axis=0) + rounding(roundings(p, q), magnitude)
    extraction = cache(_extraction)
    for patch, row in zip(patches, rows):
        nets = [net for net, _ in row]
        a = [extraction(patch.kv_u, order, p) for order in by_axis[0]]
        b = [extraction(patch.kv_v, order, q) for order in by_axis[1]]
        step = max(1, STRIP // patch.kv_v.spans)
        for first in range(0, patch.kv_u.spans, step):
            tables = [
                tensor_apply(x[first * (p + 1) : (first + step) * (p + 1)], y, net)
                for x, y, net in zip(a, b, nets)
            ]
            coefficients = (
                np.stack(tables)
                .reshape(len(nets), -1, p + 1, patch.kv_v.spans, q + 1)
                .transpose(0, 2, 4, 1, 3)
            )
            yield Cells(
                coefficients.reshape(len(nets), p + 1, q + 1, -1),
                _boxes(patch, first, step),
                magnitude,
                error,
            )


def cell_bounds(graph: BSplineSurface, derivatives: tuple[Orders, ...]) -> Floats:
    """Return bounds of |derivatives| of a scalar spline on every cell, (len(derivatives), spans u, spans v).

    Raises ValueError : as `bernstein`.
    """
    strips = [
        np.abs(c.coefficients).max(axis=(1, 2)) + c.error[:, None] for c in bernstein(graph, derivatives)
    ]
    bounds: Floats = np.concatenate(strips, axis=1)
    return bounds.reshape(len(derivatives), graph.kv_u.spans, graph.kv_v.spans)


def _patches(graph: Graph) -> tuple[list[BSplineSurface], float]:
    """Return the graph as B-spline patches and the rounding error of their coefficients."""
    if isinstance(graph, BSplineSurface | THBSurface):
        patch, error = tensor_form(graph)
        patches = [patch]
    else:
        patches, error = list(graph) if isinstance(graph, Iterable) else [graph], 0.0
    for patch in patches:
        require_type("graph", patch, BSplineSurface)
        if patch.coefficients.ndim != 2:
            raise ValueError(
                f"bounds need scalar coefficients, got a net of shape {patch.coefficients.shape}"
            )
    degrees = {(patch.kv_u.degree, patch.kv_v.degree) for patch in patches}
    if len(degrees) != 1:
        raise ValueError(f"bounds need one or more patches of equal degrees, got degrees {sorted(degrees)}")
    if all(kv.is_clamped for patch in patches for kv in patch.knot_vectors):
        return patches, error
    size = max(float(np.abs(patch.coefficients).max()) for patch in patches)
    return [patch.clamp() for patch in patches], error + rounding(roundings(*degrees.pop()), size)


def tensor_form(surface: BSplineSurface | THBSurface) -> tuple[BSplineSurface, float]:
    """Return the surface as one B-spline and a bound of the rounding errors of its coefficients."""
    if isinstance(surface, BSplineSurface):
        return surface, 0.0
    # two products with polar forms for every level of the hierarchy
    count = surface.space.levels * roundings(surface.space.kv_u.degree, surface.space.kv_v.degree)
    return surface.to_bspline(), rounding(count, float(np.abs(surface.coefficients).max()))


def _boxes(patch: BSplineSurface, first: int, step: int) -> Floats:
    u, v = patch.kv_u.breaks[first : first + step + 1], patch.kv_v.breaks
    ends = [np.meshgrid(*pair, indexing="ij") for pair in ((u[:-1], v[:-1]), (u[1:], v[1:]))]
    return np.reshape(ends, (2, 2, -1))


def _differentiated(patch: BSplineSurface, orders: Orders, error: float) -> tuple[Floats, float]:
    """Return the coefficients of a derivative, c_i' = p (c_(i+1) - c_i) / (t_(i+p+1) - t_(i+1)) in u and v,
    and their error."""
    net = patch.coefficients
    for kv, order in zip((patch.kv_u, patch.kv_v), orders):
        if order > kv.degree:
            net = np.zeros_like(net)
            error = 0.0
        for done in range(order if order <= kv.degree else 0):
            p = kv.degree - done
            knots = kv.knots[done + 1 : len(kv.knots) - done - 1]
            width = (knots[p:] - knots[:-p])[:, None]
            real = width > 0  # a function without support has no coefficient
            with np.errstate(over="ignore", invalid="ignore"):  # refused later
                change = np.diff(net, axis=0)
                net = np.divide(p * change, width, out=np.zeros_like(change), where=real)
                error = 2 * p * error / float(width[real].min()) * (1 + 8 * EPS)
            error += float(change.any()) * rounding(4, max(float(np.abs(net).max()), TINY))
        net = net.T
    return net, error


def _extraction(kv: KnotVector, order: int, degree: int) -> csr_array:
    """Return the operator from the coefficients of a derivative to Bernstein coefficients of a degree on
    every span."""
    if order > kv.degree:
        return csr_array((kv.spans * (degree + 1), kv.dim))
    p = kv.degree - order
    knots = kv.knots[order : len(kv.knots) - order]
    span = np.flatnonzero(np.diff(knots) > 0)
    rows = bezier_rows(knots[span + np.arange(1 - p, p + 1)[:, None]])
    return band_matrix(
        np.repeat(span - p, degree + 1), (_elevation(p, degree) @ rows).reshape(-1, p + 1), len(knots) - p - 1
    )


def _elevation(p: int, degree: int) -> Floats:
    """Return the degree elevation of Bernstein coefficients, (degree + 1, p + 1)."""
    rest = degree - p
    weights = [
        [comb(p, j) * comb(rest, i - j) if i >= j else 0 for j in range(p + 1)] for i in range(degree + 1)
    ]
    return np.array(weights) / [[comb(degree, i)] for i in range(degree + 1)]


def roundings(p: int, q: int) -> int:
    """Return the roundings of two products with polar forms of degrees p, q: 5 per factor, the elevation and
    the sums."""
    return 8 * (p + q + 2)
