"""How far the THB kernel is from exact rational arithmetic, and the limits of its rounding errors.

Errors are relative: values to the greatest coefficient, Q P - I to the greatest absolute row sums of Q,
derivatives to the sum of |derivatives| of the B-splines at the point times the greatest coefficient; of the
B-splines of the tensor-product form, and of those of the leaf cell's own level, which are flatter where the
cell lies in the row or column of deeper ones. The limits are u = 2^-53 times a bound of the number of
roundings on the way.  Each step of a stable method is a sum with non-negative weights that come from
differences of given numbers, so that the limit grows with degree and level, not with the knots.  Q P - I
itself is held to 1e-13 up to degree 5 on spans of ratios up to 10, as in `thbcad bench kernel`; where a
function keeps few whole cells of very unequal spans, the least functional is large and restriction loses
digits, or refuses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from oracles.exact_splines import ExactPatches, ExactTHB, roundings
from oracles.spline_definitions import gamma
from thbcad import KnotVector, THBSpace, THBSurface

POINTS = 4  # of each surface
REFUSED = "restriction refused"
Errors = dict[str, tuple[float, float]]  # quantity: (error, limit)


def measure(space: THBSpace, rng: np.random.Generator) -> Errors:
    """Return the errors of a random spline with coefficients up to 1, and their limits."""
    surface = THBSurface(space, np.append(rng.uniform(-1, 1, space.dim - 1), 1.0))
    twin = ExactTHB(surface)
    u, v = twin.sample(POINTS, rng)
    bound = roundings(space)
    exact = [twin(a, b)[0] for a, b in zip(u.tolist(), v.tolist())]
    weights = space.collocation(u, v)
    finer = further(space)
    moved = ExactTHB(THBSurface(finer, space.prolongation(finer) @ surface.coefficients))
    tensor, patches = ExactTHB.of_bspline(surface.to_bspline()), ExactPatches(surface)
    by_tensor, by_cell = _derivative_errors(surface, twin, tensor, u, v)

    def against(values: Sequence[float | Fraction]) -> float:
        return max(float(abs(Fraction(a) - b)) for a, b in zip(values, exact))

    def at_points(other: Callable[[float, float], tuple[Fraction, Fraction]]) -> list[Fraction]:
        return [other(a, b)[0] for a, b in zip(u.tolist(), v.tolist())]

    limits = [float(gamma(n)) for n in (bound, 2 * bound, roundings(finer))]
    errors = {
        "sum of functions - 1": (float(abs(weights.sum(axis=1) - 1).max()), limits[1]),
        "negative part of functions": (float(max(0.0, -weights.data.min())), 0.0),
        "values of the surface": (against(surface(u, v).tolist()), limits[0]),
        "values, collocation": (against((weights @ surface.coefficients).tolist()), limits[0]),
        "derivatives, to the tensor product's": (by_tensor, limits[0]),
        "derivatives, to the leaf cell's": (by_cell, limits[0]),
        "prolongation": (against(at_points(moved)), limits[2]),
        "to_bspline": (against(at_points(tensor)), limits[0]),
        "to_patches": (against(at_points(patches)), limits[1]),
    }
    try:
        defect, norm = projection_defect(space, finer)
    except ValueError:
        return errors | {REFUSED: (1.0, np.inf)}
    plain = (
        max(space.kv_u.degree, space.kv_v.degree) <= 5 and max(_spread(space.kv_u), _spread(space.kv_v)) <= 10
    )
    return errors | {
        "Q P - I": (defect, 1e-13 if plain else np.inf),
        "Q P - I, to row sums of |Q|": (defect / norm, limits[2]),
        "row sums of |Q|": (norm, np.inf),
    }


def _spread(kv: KnotVector) -> float:
    """Return the ratio of the longest span to the shortest."""
    return float(np.diff(kv.breaks).max() / np.diff(kv.breaks).min())


def further(space: THBSpace) -> THBSpace:
    """Return a finer space: p + 2 by q + 2 cells from the lowest leaf cell on, of the coarsest and of the
    finest level."""
    cells = {}
    for level in {int(space.cells[0, 0]), space.levels - 1}:
        leaves = space.cells[space.cells[:, 0] == level, 1:]
        window = leaves[0] // 2 * 2 + [space.kv_u.degree + 2, space.kv_v.degree + 2]
        cells[level] = leaves[(leaves < window).all(axis=1)]
    return space.refine(cells)


def projection_defect(space: THBSpace, finer: THBSpace) -> tuple[float, float]:
    """Return the greatest entry of |Q P - I|, and the greatest row sums of |Q| of one level after the other,
    multiplied."""
    product, norm, whole = space.prolongation(finer), 1.0, finer
    for level in range(finer.levels - 2, -1, -1):
        held = space.refined[level] if level < space.levels - 1 else np.zeros((0, 2), dtype=np.int64)
        extra = finer.refined[level][~(finer.refined[level][:, None] == held).all(axis=2).any(axis=1)]
        less = whole.coarsen({level: extra})
        q = whole.restriction(less)
        product, norm, whole = q @ product, norm * float(abs(q).sum(axis=1).max()), less
    product.setdiag(product.diagonal() - 1)
    return float(abs(product).max()), norm


def _derivative_errors(
    surface: THBSurface, twin: ExactTHB, tensor: ExactTHB, u: NDArray[np.float64], v: NDArray[np.float64]
) -> list[float]:
    """Return the greatest error of the first derivatives, to the scale of the tensor-product form and to that
    of the leaf cells."""
    errors = []
    for order in ((1, 0), (0, 1)):
        for a, b, value in zip(u.tolist(), v.tolist(), surface(u, v, order).tolist()):
            exact, scale = twin(a, b, order)
            error = abs(Fraction(value) - exact)
            errors.append([float(error / tensor(a, b, order)[1]), float(error / scale)])
    return np.max(errors, axis=0).tolist()


def window(space: THBSpace, rng: np.random.Generator) -> dict[int, NDArray[np.int64]]:
    """Return the leaf cells of one level, at most 3, in a random window about a random one."""
    leaves = space.cells[space.cells[:, 0] <= 3]
    level, i, j = leaves[rng.integers(len(leaves))]
    low = np.array([i, j]) - rng.integers(0, 4, 2)
    same = leaves[leaves[:, 0] == level, 1:]
    return {int(level): same[((same >= low) & (same < low + rng.integers(4, 9, 2))).all(axis=1)]}


def coarsened(surface: THBSurface, level: int, rng: np.random.Generator) -> THBSurface:
    """Return the projection of a surface to the space without some of the refined cells of a level."""
    space = surface.space
    children = (
        space.refined[level + 1] // 2 if level + 1 < len(space.refined) else np.zeros((0, 2), dtype=np.int64)
    )
    keep = (space.refined[level][:, None] == children).all(axis=2).any(axis=1) | (
        rng.random(len(space.refined[level])) < 0.3
    )
    coarser = space.coarsen({level: space.refined[level][~keep]})
    return THBSurface(coarser, space.restriction(coarser) @ surface.coefficients)


def deepest(kv: KnotVector, width: int) -> tuple[int, str]:
    """Return the deepest level that the lowest cells reach, and the sentence that refuses the next."""
    space, block = THBSpace(kv, kv), np.argwhere(np.ones((width, width)))
    for level in range(64):
        try:
            space = space.refine({level: block})
            THBSurface(space, np.ones(space.dim)).to_bspline()
        except ValueError as error:
            return level, str(error)
    raise AssertionError("nothing refuses level 64")
