"""Which cells to refine: indicators per leaf cell, and marking by them.

- vertex: the gradients of the loss by the heights of a grid of vertices (thesis 6.1-6.3);
- slope: how far the slopes of the sag are from those that the transport start asks for;
- decrease: the fall of the loss that the functions of the next level promise, g^2 / (2 h) each, with the
  gradient g and the diagonal h of the Gauss-Newton Hessian: about the decrease per degree of freedom.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from thbcad.checks import Bools, Floats, Integers
from thbcad.fitting import cell_shares
from thbcad.hierarchy import THBSpace
from thbcad.outlines import Outline
from thbcad.splines import KnotVector

ASIDE = tuple((a, b) for a in (-0.25, 0.25) for b in (-0.25, 0.25))  # of a span of the function's level
LEAST = 1e-3  # of the mean: smaller entries of the Hessian's diagonal count as that


def vertex_knots(half_width: Sequence[float], counts: Sequence[int]) -> tuple[KnotVector, ...]:
    """Return degree-1 knot vectors whose knots are a grid of vertices over the surface (6.1)."""
    return tuple(KnotVector.uniform(1, n - 1, -h, h) for n, h in zip(counts, half_width))


def refined_once(space: THBSpace, max_level: int) -> THBSpace:
    """Return the space with every leaf cell below a level refined."""
    return space.refine(space.cells[:, 0] < max_level)


def promised_decrease(space: THBSpace, finer: THBSpace, gradient: Floats, probes: Sequence[Floats]) -> Floats:
    """Return for every leaf cell the sum of g^2 / (2 h) over the new functions of a finer space, (n_cells,).

    A function counts for the cell in which its middle lies.

    gradient : g, (finer.dim,)
    probes : vectors whose mean square is h / 2
    """
    half = np.mean(np.square(probes), axis=0)
    least = LEAST * half.mean() or 1.0  # without light there is no curvature, and no gradient
    decrease = np.square(gradient) / (4 * np.maximum(half, least))
    old = {tuple(row) for row in space.functions.tolist()}
    new = np.array([tuple(row) not in old for row in finer.functions.tolist()])
    level, *index = finer.functions[new].T
    out = np.zeros(len(space.cells))
    for aside in ASIDE:  # middles lie on knot lines or between them: beside them the cell is certain
        middle = []
        for i, kv, a in zip(index, (finer.kv_u, finer.kv_v), aside):
            relative = np.clip((i + (1 - kv.degree) / 2 + a) / ((kv.dim - kv.degree) << level), 0, 1)
            middle.append(kv.start + relative * (kv.stop - kv.start))
        out += np.bincount(space.locate(*middle), decrease[new] / len(ASIDE), len(out))
    return out


def near_cells(space: THBSpace, outline: Outline) -> Bools:
    """Return which leaf cells lie in an outline, or beside it within p / 2 of their sides, (n_cells,).

    All functions that see light are then as fine as their cells.

    outline : it is stretched over the rectangle of the space.
    """
    if outline.is_rectangle:
        return np.ones(len(space.cells), dtype=bool)
    return cell_shares(space, outline, (space.kv_u.degree / 2, space.kv_v.degree / 2)) > 0


def mark(
    space: THBSpace,
    indicator: Floats,
    alpha: float,
    max_level: int,
    near: Bools | None = None,
) -> dict[int, Integers]:
    """Return {level: cells} of the leaf cells with Z > alpha * mean(Z), below `max_level`.

    The mean is taken over the active cells (thesis 6.3 divides by the number of cells of a full level
    instead).

    near : which cells count at all; None are all.
    """
    cells = space.cells
    near = np.ones(len(cells), dtype=bool) if near is None else near
    wanted = near & (indicator > alpha * indicator[near].mean())
    chosen = cells[wanted & (cells[:, 0] < max_level)]
    return {int(level): chosen[chosen[:, 0] == level, 1:] for level in np.unique(chosen[:, 0])}
