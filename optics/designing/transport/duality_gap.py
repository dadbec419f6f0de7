"""A transport plan that fits both densities exactly, made of a map that nearly does, and what it costs.

The map of psi carries f to some g'.  What lies in excess of g is moved on to where light is lacking, within
blocks of 2 x 2 cells, then of 4 x 4, until all is moved; in a block every excess feeds every lack in
proportion.  The composed plan, of x to y' to y, costs

    E |x - y'|^2 / 2 + E (x - y') . (y' - y) + E |y' - y|^2 / 2,

where the middle of all x that reach y' stands for x in the second term.  No plan costs less than the dual
value J, so that cost and J enclose the optimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

import numpy as np

from optics.base.runtime import Backend
from optics.designing.transport.push_forward import push_forward
from thbcad.checks import Floats

# empty rows and columns in front of the blocks of each size in turn: with the second, borders of blocks of
# all sizes do not meet where a checkerboard has its own; with the first they follow halves that are alike
IN_FRONT = (0, 0), (1, 0)


def plan_cost(backend: Backend, psi: Floats, f: Floats, g: Floats, spacing: Sequence[float]) -> float:
    """Return the mean of |x - y|^2 / 2 of a plan between f and g, of mean 1, that follows x - grad psi."""
    x, y = np.meshgrid(*(h * (np.arange(n) + 0.5) for h, n in zip(spacing, f.shape)), indexing="ij")
    square = (x**2 + y**2) / 2
    carried, from_x, from_y, from_square = (
        push_forward(backend, psi, f * weight, spacing) for weight in (1.0, x, y, square)
    )
    moved = np.sum(from_square - from_x * x - from_y * y + carried * square)
    aside_x, aside_y = (
        np.divide(a, carried, out=b.copy(), where=carried > 0) - b for a, b in ((from_x, x), (from_y, y))
    )
    excess, lack = np.maximum(carried - g, 0), np.maximum(g - carried, 0)
    given = [excess * m for m in (1.0, x, y, square + aside_x * x + aside_y * y, aside_x, aside_y)]
    taken = [lack * m for m in (1.0, x, y, square)]
    return float(moved + min(_repair_cost(given, taken, fronts) for fronts in IN_FRONT)) / f.size


def _repair_cost(given: Sequence[Floats], taken: Sequence[Floats], fronts: Sequence[int]) -> float:
    """Return what it costs to move every excess to a lack, which are in no cell together.

    given : moments of the excess, (nx, ny) each: its light, times y', times |y'|^2 / 2 + (x - y') . y', times
        x - y'.  taken : of the lack: its light, times y, times |y|^2 / 2.
    """
    cost, excess, lack = 0.0, np.array(given), np.array(taken)
    for front in cycle(fronts):
        excess, lack = (_block_sums(of, front) for of in (excess, lack))
        both = np.minimum(excess[0], lack[0])
        gone, fed = (_part(moments, both) for moments in (excess, lack))
        places = _ratio(fed[1:3], both)
        cost += float(np.sum(gone[3] + fed[3]) - np.sum(places * (gone[1:3] + gone[4:6])))
        if both.size == 1:
            break
        excess, lack = excess - gone, lack - fed
    return cost


def _part(moments: Floats, light: Floats) -> Floats:
    """Return the moments of some of the light of every block, alike of all that is in it."""
    return moments * _ratio(light, moments[0])


def _ratio(values: Floats, light: Floats) -> Floats:
    """Return values per light, 0 where there is none."""
    return np.divide(values, light, out=np.zeros_like(values), where=light > 0)


def _block_sums(values: Floats, front: int) -> Floats:
    """Return sums over blocks of 2 x 2 of the last two axes.

    front : empty rows and columns before the first block.
    """
    values = np.pad(values, [(0, 0), *((front, (n + front) % 2) for n in values.shape[1:])])
    rows = values[:, ::2] + values[:, 1::2]
    return np.asarray(rows[:, :, ::2] + rows[:, :, 1::2])
