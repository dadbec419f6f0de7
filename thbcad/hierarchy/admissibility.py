"""Admissible refinement: few levels meet on every cell.

A hierarchy is admissible of class m when the truncated functions that act on a cell belong to at
most m successive levels.  The level of the cell does not count: a few fine cells carry coarse functions only.

What refinement keeps is stricter: on a cell of level l act functions of the levels l - m + 1 to l.  A
hierarchy that starts as a tensor-product space stays so when a cell Q of level l is refined after its
T-neighbourhood: the leaf cells of level l - m + 1 that meet the support extension of Q at level l - m + 2,
the union of the supports of the functions that act on Q there.

Source: A. Buffa, C. Giannelli, Adaptive isogeometric methods with hierarchical splines: error
estimator and convergence, M3AS 26 (2016); C. Bracco, C. Giannelli, R. Vazquez, Refinement
algorithms for adaptive isogeometric methods with hierarchical splines, Axioms 7 (2018).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from thbcad.checks import Integers, require_integer
from thbcad.hierarchy.domains import Domains
from thbcad.hierarchy.levels import DyadicAxis


def closure(domains: Domains, cells: Mapping[int, Integers], m: int) -> dict[int, Integers]:
    """Return the cells to refine together with `cells` so that class m is kept, {level: (n, 2) int}.

    Raises
    ------
    ValueError : m that is not an integer of at least 2.
    """
    require_integer("the class of admissibility", m, 2)
    marked = dict(cells)
    for level in range(max(marked, default=0), m - 2, -1):
        coarse = level - m + 1
        if level not in marked or coarse < 0:
            continue
        parents = _neighbourhood(domains, level, marked[level], coarse)
        if len(parents):
            marked[coarse] = np.unique(np.concatenate([marked.get(coarse, parents), parents]), axis=0)
    return marked


def _neighbourhood(domains: Domains, level: int, pairs: Integers, coarse: int) -> Integers:
    """Return the leaf cells of level `coarse` in the T-neighbourhood of cells of a level, (n, 2) int."""
    ancestors = np.unique(pairs >> (level - coarse - 1), axis=0)
    ranges = [_parents_range(axis, coarse + 1, ancestors[:, d]) for d, axis in enumerate(domains.axes)]
    (low_u, steps_u), (low_v, steps_v) = ranges
    i = low_u[:, None, None] + np.minimum(np.arange(steps_u.max() + 1)[:, None], steps_u[:, None, None])
    j = low_v[:, None, None] + np.minimum(np.arange(steps_v.max() + 1), steps_v[:, None, None])
    i, j = np.broadcast_arrays(i, j)
    keys = np.unique(domains.keys(coarse, np.stack([i.ravel(), j.ravel()], axis=1)))
    return domains.pairs(coarse, np.intersect1d(keys, domains.leaves(coarse), assume_unique=True))


def _parents_range(axis: DyadicAxis, level: int, spans: Integers) -> tuple[Integers, Integers]:
    """Return (first, steps): the spans of level - 1 that meet the supports of all functions acting on each
    span of a level."""
    first = axis.acting(level, spans)
    low = axis.support(level, first)[0] >> 1
    high = (axis.support(level, first + axis.degree)[1] - 1) >> 1
    return low, high - low
