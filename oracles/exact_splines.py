"""THB splines in exact arithmetic, and the errors of the kernel against them.

Knots, coefficients and parameters are float64 numbers taken exactly.  The knots of level l between two
neighbouring knots a and b of level 0 are the float64 numbers nearest to a + (b - a) k / 2^l that the kernel
computes: `exact` means the spline on these rounded knots.  Functions, cells and their numbers are those that
`THBSpace` states.
"""

from __future__ import annotations

from bisect import bisect_right
from fractions import Fraction

import numpy as np

from oracles.spline_definitions import cox_de_boor
from thbcad import THBSpace, THBSurface


def discrete(near, arguments):
    """Return the polar form's weights of the p + 1 coefficients of a span: the Oslo algorithm.

    near : the p knots on either side of the span's inside, arguments : p numbers.
    """
    p = len(arguments)
    weights = [Fraction(1)]
    for k, x in enumerate(arguments, 1):
        shares = [(x - near[p - k + r]) / (near[p + r] - near[p - k + r]) for r in range(k)]
        lower = [w * (1 - s) for w, s in zip(weights, shares)]
        upper = [w * s for w, s in zip(weights, shares)]
        weights = [a + b for a, b in zip([*lower, 0], [0, *upper])]
    return weights


def roundings(space):
    """Return a bound of the roundings between coefficients and a value: 5 per degree in a weight, and the
    sums, for every level."""
    p, q = space.kv_u.degree, space.kv_v.degree
    return (5 * (p + q) + (p + 2) * (q + 2)) * space.levels


class ExactAxis:
    """Knots and two-scale relations of all levels above one knot vector, local and in Fractions."""

    def __init__(self, kv):
        breaks, counts = np.unique(kv.knots, return_counts=True)
        self.degree, self.breaks, self.counts = kv.degree, breaks.tolist(), counts.tolist()
        self.surplus = [0, *np.cumsum(counts - 1).tolist()]
        self._rows, self._values = {}, {}

    def position(self, level, number):
        """Return break `number` of a level as the kernel's float64 number."""
        whole, part = divmod(number, 1 << level)
        if not part:
            return self.breaks[whole]
        return self.breaks[whole] + (self.breaks[whole + 1] - self.breaks[whole]) * (part / (1 << level))

    def knot_break(self, level, index):
        """Return the number of the break at which knot `index` of a level lies."""
        firsts = [(b << level) + s for b, s in enumerate(self.surplus[:-1])]
        whole = bisect_right(firsts, index) - 1
        return (whole << level) + max(0, index - firsts[whole] - self.counts[whole] + 1)

    def knots(self, level, start, stop):
        """Return the knots start ... stop - 1 of a level."""
        return [Fraction(self.position(level, self.knot_break(level, k))) for k in range(start, stop)]

    def span(self, level, x):
        """Return the span of a level that holds x."""
        count = len(self.breaks) - 1 << level
        return bisect_right(range(count), x, key=lambda number: self.position(level, number)) - 1

    def inner(self, level, span):
        """Return the index of the last knot at the left end of a span."""
        whole = span >> level
        return (
            span + self.surplus[whole] + self.counts[whole] - 1
            if span == whole << level
            else span + self.surplus[whole + 1]
        )

    def two_scale(self, level, index):
        """Return {function of level - 1: weight} of function `index` of a level."""
        if (level, index) not in self._rows:
            p, mu = self.degree, self.inner(level - 1, self.knot_break(level, index) >> 1)
            near = self.knots(level - 1, mu + 1 - p, mu + p + 1)
            weights = discrete(near, self.knots(level, index + 1, index + p + 1))
            self._rows[level, index] = {mu - p + r: w for r, w in enumerate(weights) if w}
        return self._rows[level, index]

    def basis(self, level, span, u, derivative=0):
        """Return {function: derivative at u} of the functions of a level that act on a span."""
        key = level, span, u, derivative
        if key not in self._values:
            p, mu = self.degree, self.inner(level, span)
            values, _ = cox_de_boor(self.knots(level, mu - p, mu + p + 2), p, u, derivative)
            self._values[key] = dict(zip(range(mu - p, mu + 1), values))
        return self._values[key]


class ExactTHB:
    """The exact twin of a THBSurface with scalar coefficients."""

    def __init__(self, surface):
        space = surface.space
        self.axes = ExactAxis(space.kv_u), ExactAxis(space.kv_v)
        self.levels, self.cells = space.levels, list(map(tuple, space.cells.tolist()))
        self._leaves = set(self.cells)
        own = map(Fraction, surface.coefficients.tolist())
        self._coefficients = dict(zip(map(tuple, space.functions.tolist()), own))

    @classmethod
    def of_bspline(cls, surface):
        """Return the twin of a tensor-product surface."""
        return cls(THBSurface(THBSpace(surface.kv_u, surface.kv_v), surface.coefficients.ravel()))

    def coefficient(self, level, i, j):
        """Return the level's own B-spline coefficient: refine, then overwrite."""
        key = level, i, j
        if key not in self._coefficients:
            u, v = self.axes[0].two_scale(level, i), self.axes[1].two_scale(level, j)
            self._coefficients[key] = sum(
                a * b * self.coefficient(level - 1, k, m) for k, a in u.items() for m, b in v.items()
            )
        return self._coefficients[key]

    def corners(self, cell):
        """Return ((u0, u1), (v0, v1)) of a cell (level, i, j), float64."""
        level, *numbers = cell
        return tuple(
            (axis.position(level, k), axis.position(level, k + 1)) for axis, k in zip(self.axes, numbers)
        )

    def sample(self, count, rng):
        """Return (u, v), (8 count,) float: in random cells of the finest level and of any, at their lower
        corners, and crossed.

        Crossed: u of a cell of the finest level and v of another, and the other way round.
        """
        finest = [cell for cell in self.cells if cell[0] == self.levels - 1]
        cells = [among[k] for among in (finest, self.cells) for k in rng.choice(len(among), count)]
        low, high = np.array([self.corners(cell) for cell in cells]).transpose(2, 1, 0)
        inside = np.minimum(low + (high - low) * rng.random(low.shape), np.nextafter(high, -np.inf))
        u, v = np.concatenate([inside, low], axis=1)
        return np.r_[u, u], np.r_[v, v[::-1]]

    def cell_at(self, u, v):
        """Return the leaf cell (level, i, j) that holds a point; the last cells are closed."""
        for level in range(self.levels):
            cell = level, self.axes[0].span(level, u), self.axes[1].span(level, v)
            if cell in self._leaves:
                return cell
        raise ValueError(f"no cell holds ({u}, {v})")

    def __call__(self, u, v, derivative=(0, 0)):
        """Return (value, scale): the derivative at (u, v) and the sum of |derivatives| of the cell's own
        B-splines."""
        level, i, j = self.cell_at(u, v)
        by_u = self.axes[0].basis(level, i, u, derivative[0])
        by_v = self.axes[1].basis(level, j, v, derivative[1])
        value = sum(a * b * self.coefficient(level, k, m) for k, a in by_u.items() for m, b in by_v.items())
        return value, sum(map(abs, by_u.values())) * sum(map(abs, by_v.values()))


class ExactPatches:
    """The exact twin of the patches of a THBSurface with scalar coefficients."""

    def __init__(self, surface):
        self.patches, self._twins = surface.to_patches(), {}
        self.ends = surface.space.kv_u.stop, surface.space.kv_v.stop

    def index(self, u, v):
        """Return the number of the patch that holds a point; the last patches are closed."""
        return next(
            k
            for k, patch in enumerate(self.patches)
            if all(
                kv.start <= x < kv.stop or x == kv.stop == end
                for kv, x, end in zip((patch.kv_u, patch.kv_v), (u, v), self.ends)
            )
        )

    def __call__(self, u, v, derivative=(0, 0)):
        """Return (value, scale) as ExactTHB does."""
        index = self.index(u, v)
        if index not in self._twins:
            self._twins[index] = ExactTHB.of_bspline(self.patches[index])
        return self._twins[index](u, v, derivative)
