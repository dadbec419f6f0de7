"""Slow twins of the kernel, written from the definitions and sharing no code with it."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline

UNIT = Fraction(1, 2**53)  # unit roundoff of float64


def gamma(roundings):
    """Higham's bound n u / (1 - n u) on the relative error of n roundings."""
    return roundings * UNIT / (1 - roundings * UNIT)


def over(a, b):
    return a / b if b else Fraction(0)


def cox_de_boor(knots, degree, u, derivative=0):
    """Return (values, sizes): all B-splines at u in exact arithmetic, and the same sums with every minus made
    plus.

    The last interval is closed.  A term-by-term computation with n roundings errs by at most gamma(n) *
    sizes.
    """
    t, u = [Fraction(float(x)) for x in knots], Fraction(float(u))
    last = max(k for k in range(len(t) - 1) if t[k] < t[k + 1])
    values = [Fraction(t[k] <= u < t[k + 1] or (u == t[-1] and k == last)) for k in range(len(t) - 1)]
    steep = max(degree - derivative, 0)
    for k in range(1, steep + 1):
        parts = _parts(values, t, k)
        # most functions are zero at u: sums of zeros are left out
        values = [
            (u - t[i]) * a + (t[i + k + 1] - u) * b if a or b else a
            for i, (a, b) in enumerate(pairwise(parts))
        ]
    sizes = values  # nothing is subtracted before the first difference
    for k in range(steep + 1, degree + 1):
        below, above = _parts(values, t, k), _parts(sizes, t, k)
        values = [k * (a - b) for a, b in pairwise(below)]
        sizes = [k * (a + b) for a, b in pairwise(above)]
    return values, sizes


def _parts(values, t, k):
    """Return the B-splines of degree k - 1, each over the width of its support; 0 / 0 is 0."""
    return [over(x, t[i + k] - t[i]) if x else x for i, x in enumerate(values)]


def boehm(knots, degree, new):
    """Return the matrix of knot insertion, one knot at a time, as rows of Fractions."""
    t = [Fraction(float(x)) for x in knots]
    n = len(t) - degree - 1
    rows = [[Fraction(i == j) for j in range(n)] for i in range(n)]
    for x in sorted(Fraction(float(x)) for x in new):
        mu = max(k for k in range(len(t)) if t[k] <= x)
        out = []
        for i in range(len(rows) + 1):
            if i <= mu - degree:
                out.append(rows[i])
            elif i > mu:
                out.append(rows[i - 1])
            else:
                a = (x - t[i]) / (t[i + degree] - t[i])
                out.append([a * r + (1 - a) * s for r, s in zip(rows[i], rows[i - 1])])
        rows, t = out, [*t[: mu + 1], x, *t[mu + 1 :]]
    return rows


def bisected(knots, degree):
    """Return (knots, matrix): one knot more in the middle of every non-empty span; the matrix in float64."""
    middles = [a + (b - a) / 2 for a, b in pairwise(knots) if a < b]
    matrix, t = np.eye(len(knots) - degree - 1), list(knots)
    for x in middles:
        mu = max(k for k in range(len(t)) if t[k] <= x)
        n = len(t) - degree - 1
        step = np.zeros((n + 1, n))
        for i in range(n + 1):
            a = 1.0 if i <= mu - degree else 0.0 if i > mu else (x - t[i]) / (t[i + degree] - t[i])
            if a:
                step[i, i] = a
            if a < 1:
                step[i, i - 1] = 1 - a
        matrix = step @ matrix
        t.insert(mu + 1, x)
    return np.array(t), matrix


def support(knots, degree, i):
    """Return the non-empty spans, counted from 0, under B-spline i."""
    breaks = np.unique(knots)
    return [
        s for s in range(len(breaks) - 1) if knots[i] <= breaks[s] and breaks[s + 1] <= knots[i + degree + 1]
    ]


class DefinitionTHB:
    """The truncated basis of Giannelli, Juettler and Speleers as nets of the finest full tensor-product
    level.

    functions : list of (level, i, j), in the order level, i, j
    nets : (n_u, n_v, dim), knots : the knot vectors of the finest level
    """

    def __init__(self, kv_u, kv_v, refined):
        self.degrees = kv_u.degree, kv_v.degree
        knots = [[np.array(kv_u.knots)], [np.array(kv_v.knots)]]
        steps = [[], []]
        for _ in refined:
            for d in (0, 1):
                finer, matrix = bisected(knots[d][-1], self.degrees[d])
                knots[d].append(finer)
                steps[d].append(matrix)
        domains = [None]  # Omega_l as cells of level l; None: everything
        for cells in refined:
            domains.append({(2 * i + a, 2 * j + b) for i, j in cells for a in (0, 1) for b in (0, 1)})
        self.functions, nets = [], []
        for level in range(len(refined) + 1):
            inside = self._within(knots, level, domains[level])
            # Omega_(l+1) as cells of level l: the refined ones
            active = inside & ~self._within(knots, level, refined[level] if level < len(refined) else set())
            for i, j in np.argwhere(active).tolist():
                self.functions.append((level, i, j))
                net = np.zeros(active.shape)
                net[i, j] = 1.0
                nets.append(net)
            if level < len(refined):
                nets = [steps[0][level] @ n @ steps[1][level].T for n in nets]
                # truncate: drop what lies in the next domain
                drop = self._within(knots, level + 1, domains[level + 1])
                nets = [np.where(drop, 0.0, n) for n in nets]
        self.knots = knots[0][-1], knots[1][-1]
        self.nets = np.stack(nets, axis=-1)

    def _within(self, knots, level, domain):
        """Return for each function of a level whether all cells of its support lie in the domain (None:
        everywhere)."""
        spans = [
            [
                support(knots[d][level], self.degrees[d], i)
                for i in range(len(knots[d][level]) - self.degrees[d] - 1)
            ]
            for d in (0, 1)
        ]
        if domain is None:
            return np.ones((len(spans[0]), len(spans[1])), dtype=bool)
        return np.array(
            [[all((a, b) in domain for a in su for b in sv) for sv in spans[1]] for su in spans[0]]
        )

    def collocation(self, u, v, derivative=(0, 0)):
        """Return the values of all functions at scattered points, (n, dim), by scipy."""
        by_u, by_v = (
            BSpline(t, np.eye(len(t) - p - 1), p, extrapolate=False)(x, nu=r)
            for t, p, x, r in zip(self.knots, self.degrees, (u, v), derivative)
        )
        return np.einsum("ka,kb,abf->kf", by_u, by_v, self.nets, optimize=True)


def flux_volume(lens, nodes=48):
    """Return the volume of a lens as the flux of (0, 0, z) through its six faces.

    Only values of the two surfaces enter, at Gauss points between the breaks of their splines.  A ruled face
    X(s, w) = (1 - w) F(s) + w R(s) has the normal component -h_d(w) (h_R - h_F) of the other direction; w is
    integrated by hand.
    """
    sides = []
    for surface, vertex in ((lens.front, 0.0), (lens.rear, lens.thickness)):
        (s, ws), (t, wt) = (gauss(rim_breaks(surface, d), nodes) for d in (0, 1))
        a, b = surface.half_width
        whole = a * b * (ws @ (vertex + surface.grid(s * a, t * b)) @ wt)
        low_and_high = np.array([-1.0, 1.0])
        along_x = ws @ (vertex + surface.grid(s * a, low_and_high * b)).sum(axis=1)
        along_y = wt @ (vertex + surface.grid(low_and_high * a, t * b)).sum(axis=0)
        sides.append((whole, (along_x, along_y)))
    (front, front_rims), (rear, rear_rims) = sides
    start = lens.front.half_width
    growth = [r - f for f, r in zip(start, lens.rear.half_width)]
    total = rear - front
    for d in (0, 1):
        by_front, by_rear = start[d] / 2 + growth[d] / 6, start[d] / 2 + growth[d] / 3
        total -= growth[1 - d] * (by_front * front_rims[d] + by_rear * rear_rims[d])
    return float(total)


def rim_breaks(surface, d):
    """Return the breaks of the sag in one direction, mapped to [-1, 1]."""
    if surface.sag is None:
        return np.array([-1.0, 1.0])
    space = surface.sag.to_bspline()
    t = np.unique((space.kv_u, space.kv_v)[d].knots)
    return 2 * (t - t[0]) / (t[-1] - t[0]) - 1


def gauss(breaks, nodes):
    """Return Gauss-Legendre points and weights on every interval."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    half = np.diff(breaks)[:, None] / 2
    return (breaks[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()
