"""Gauss quadrature: on the spans of splines, of lengths and areas, and by Green's theorem over regions in a
surface's parameters.

    integral of f over a region = integral of G dv round it,  G(u, v) = integral of f(., v) from u_0 to u.

f is smooth between lines u = u_i and v = v_j, such as the knots of a spline.  On every cell f is integrated
by Gauss's rule in u, and the integrals over whole cells are interpolated in v through Gauss's nodes.  Both
are exact for polynomials.

Source: A. Sommariva and M. Vianello, Product Gauss cubature over polygons based on Green's integration
formula, BIT 47 (2007).
"""

from collections.abc import Callable
from functools import cache
from typing import Protocol

import numpy as np
from numpy.polynomial.legendre import legvander

from thbcad.checks import Floats
from thbcad.splines.knot_vector import KnotVector

STRIP = 2**18  # nodes that are taken at once
ROWS = 512  # of nodes of an area, at once
LEAST_SPANS = 32  # per direction, of lengths and areas

leggauss = cache(np.polynomial.legendre.leggauss)  # nobody writes into its arrays


class Integrand(Protocol):
    """A function f(u, v)."""

    def __call__(self, u: Floats, v: Floats) -> Floats:
        """Return the values at points, (n,) each, as (n,)."""

    def grid(self, u: Floats, v: Floats) -> Floats:
        """Return the values on the grid u x v, (len(u), len(v))."""


def gauss_rule(breaks: Floats, n: int) -> tuple[Floats, Floats]:
    """Return nodes and weights of the Gauss rule with n nodes on every span between breaks, (spans n,) each.

    It is exact for piecewise polynomials of degree 2 n - 1.
    """
    nodes, weights = leggauss(n)
    half = np.diff(breaks)[:, None] / 2
    return (breaks[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()


def grid_integral(f: Integrand, u: Floats, v: Floats, nodes: tuple[int, int]) -> float:
    """Return the integral of f over the rectangle of the lines u and v by Gauss's rules on all cells."""
    (at_u, wu), (at_v, wv) = gauss_rule(u, nodes[0]), gauss_rule(v, nodes[1])
    step = max(1, STRIP // len(at_v))
    parts = (slice(first, first + step) for first in range(0, len(at_u), step))
    return sum(float(wu[part] @ f.grid(at_u[part], at_v) @ wv) for part in parts)


def length(slope: Callable[[Floats], Floats], kv: KnotVector) -> tuple[float, float]:
    """Return the integral of |C'|, of numbers sqrt(1 + y'^2), by p + 1 points a span; its change from p."""
    lengths = []
    for n in (kv.degree, kv.degree + 1):
        u, weights = _nodes(kv, n)
        speed = slope(u)
        lengths.append(float(weights @ (np.hypot(1, speed) if speed.ndim == 1 else _norm(speed))))
    return lengths[1], abs(lengths[1] - lengths[0])


def area(grid: Callable[..., Floats], kv_u: KnotVector, kv_v: KnotVector) -> tuple[float, float]:
    """Return the integral of |S_u x S_v|, of numbers sqrt(1 + z_u^2 + z_v^2), as `length` does."""
    p = max(kv_u.degree, kv_v.degree)
    areas = []
    for n in (p, p + 1):
        (u, wu), (v, wv) = (_nodes(kv, n) for kv in (kv_u, kv_v))
        areas.append(0.0)
        for first in range(0, len(u), ROWS):
            part = slice(first, first + ROWS)
            s_u, s_v = (grid(u[part], v, orders) for orders in ((1, 0), (0, 1)))
            areas[-1] += float(wu[part] @ _stretch(s_u, s_v) @ wv)
    return areas[1], abs(areas[1] - areas[0])


def _stretch(s_u: Floats, s_v: Floats) -> Floats:
    """Return the area by du dv: |S_u| times the size of the part of S_v across it."""
    if s_u.ndim == 2:
        return np.sqrt(1 + s_u**2 + s_v**2)
    size = _norm(s_u)
    along = np.divide(s_u, size[..., None], out=np.zeros_like(s_u), where=size[..., None] > 0)
    return size * _norm(s_v - (s_v * along).sum(axis=-1, keepdims=True) * along)


def _norm(rows: Floats) -> Floats:
    norms: Floats = np.linalg.norm(rows, axis=-1)
    return norms


def _nodes(kv: KnotVector, points: int) -> tuple[Floats, Floats]:
    """Return Gauss points and weights on every span, the spans cut into equal parts where they are few."""
    parts = -(-LEAST_SPANS // kv.spans)
    steps = np.arange(parts) / parts
    starts = (kv.breaks[:-1, None] + np.diff(kv.breaks)[:, None] * steps).ravel()
    x, weights = gauss_rule(np.append(starts, kv.stop), points)
    return np.clip(x, kv.start, kv.stop), weights


class Primitive:
    """G(u, v), the integral of f(., v) from the first line in u to u.

    u, v : lines between which f is smooth, increasing.
    nodes : of the rules in u and in v on every cell, exact for degrees 2 nodes[0] - 1 and nodes[1] - 1.
    """

    def __init__(self, f: Integrand, u: Floats, v: Floats, nodes: tuple[int, int]) -> None:
        self._f = f
        self._lines = u, v
        self._nodes = nodes
        (at_u, weights), (at_v, _) = gauss_rule(u, nodes[0]), gauss_rule(v, nodes[1])
        step = max(1, STRIP // (nodes[0] * len(at_v))) * nodes[0]  # whole cells
        sums = [np.zeros((1, len(at_v)))]
        for first in range(0, len(at_u), step):
            part = slice(first, first + step)
            values = weights[part, None] * f.grid(at_u[part], at_v)
            sums.append(values.reshape(-1, nodes[0], len(at_v)).sum(axis=1))
        self._whole = np.cumsum(np.concatenate(sums), axis=0).reshape(len(u), len(v) - 1, nodes[1])

    def __call__(self, u: Floats, v: Floats) -> Floats:
        """Return G at points between the first and the last lines, (n,) each, as (n,)."""
        i, j = (
            np.clip(np.searchsorted(lines, x, side="right") - 1, 0, len(lines) - 2)
            for lines, x in zip(self._lines, (u, v))
        )
        lines, (count, order) = self._lines, self._nodes
        local = 2 * (v - lines[1][j]) / (lines[1][j + 1] - lines[1][j]) - 1
        at_nodes = legvander(leggauss(order)[0], order - 1)
        weights = np.linalg.solve(at_nodes.T, legvander(local, order - 1).T)  # of the values at the nodes
        whole = np.einsum("mn,nm->n", weights, self._whole[i, j])
        x, w = leggauss(count)
        half = (u - lines[0][i]) / 2
        inner = lines[0][i][:, None] + half[:, None] * (1 + x)
        values = self._f(inner.ravel(), np.repeat(v, count)).reshape(inner.shape)
        result: Floats = whole + half * (values @ w)
        return result
