"""Adaptive fitting of functions and samples to a tolerance.

Source: C. Giannelli, B. Juettler, H. Speleers, THB-splines, CAGD 29 (2012), section 6; G. Kiss et al.,
Adaptive CAD model (re-)construction with THB-splines, Graphical Models 76 (2014).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thbcad.checks import Floats, Integers, require_integer, require_number, require_type
from thbcad.fitting.cell_samples import cell_points, gauss_points
from thbcad.fitting.least_squares_fit import Samples, Underdetermined, least_squares
from thbcad.hierarchy import MAX_LEVEL, THBSpace
from thbcad.splines import Function, evaluate
from thbcad.surfaces import THBSurface

PATIENCE = 3  # refinements without a smaller error: the cells at fault are then 8 times smaller
HELD_OUT = 3  # one sample in three
MOST_FUNCTIONS = 300_000

Outcome = Literal["reached", "max level", "no progress", "too few samples", "too large"]


class Step(NamedTuple):
    """Degrees of freedom and error of one fit."""

    dim: int
    error: float


@dataclass(frozen=True, eq=False)
class Fit:
    """The fit of least error, and how the search ended.

    outcome : "reached" (error <= tolerance), "max level" (no cell above the tolerance may be refined
        further, or cells would be too short for float64), "no progress" (three refinements did not lower the
        error of the cells that may be refined: noise, a jump), "too few samples" (they do not determine a
        spline of the next space) or "too large" (the next space has more than 300,000 functions).
    history : one Step for every fit, coarsest first.
    """

    surface: THBSurface
    error: float
    outcome: Outcome
    history: tuple[Step, ...]


def fit(
    space: THBSpace, target: Function | Samples, tolerance: float, max_level: int = 6, smoothing: float = 0.0
) -> Fit:
    """Return a spline of this space, refined where needed, that differs from the target by at most
    `tolerance`.

    Fits by least squares, measures the error on every leaf cell, refines the cells above the
    tolerance together with their neighbours (`surroundings`), and so on.

    A function is sampled for the fit at (p + 1)(q + 1) Gauss points of every leaf cell, weighted by
    area (the L2 projection), and for the error at (p + 2)(q + 2) other points.  Of given samples of
    positive weight a random third (the same in every call) is held out of the fit; the error is measured
    at all of them.  It is no bound: what lies between the points is not seen.

    Parameters
    ----------
    target : a function of u and v, (n,) float each, that returns (n,) or (n, d); or samples
    tolerance : greatest distance |s - target|, in the unit of the target
    max_level : cells of this level are not refined, 0 to 24
    smoothing : as in `least_squares`

    Raises
    ------
    ValueError : a tolerance that is not positive, a level outside 0..24, fewer than three samples of positive
        weight, function values that are not finite.
    Underdetermined : the samples do not determine a spline of the given space.
    """
    require_type("space", space, THBSpace)
    require_number("tolerance", tolerance, above=0)
    require_integer("max_level", max_level, 0, MAX_LEVEL)
    if isinstance(target, Samples):
        target = target[target.weights > 0]
        if len(target) < HELD_OUT:
            raise ValueError(f"a fit needs at least {HELD_OUT} samples of positive weight, got {len(target)}")
        approximate = partial(least_squares, samples=target[~held_out(len(target))], smoothing=smoothing)
        measure = partial(_sample_errors, samples=target)
    else:
        approximate = partial(_projected, function=target, smoothing=smoothing)
        measure = partial(_function_errors, function=target)
    return _refined(space, approximate, measure, tolerance, max_level)


def held_out(count: int) -> NDArray[np.bool_]:
    """Return which of so many samples a fit does not see, (count,) bool: a random third, always the same."""
    chosen = np.zeros(count, dtype=bool)
    chosen[np.random.default_rng(0).permutation(count)[: count // HELD_OUT]] = True
    return chosen


def _refined(
    space: THBSpace,
    approximate: Callable[[THBSpace], THBSurface],
    measure: Callable[[THBSurface], Floats],
    tolerance: float,
    max_level: int,
) -> Fit:
    """Return the fit: approximate, measure the error of every leaf cell, refine, until there is an
    outcome."""
    best = surface = approximate(space)
    history = []
    below = []
    while True:
        errors = measure(surface)
        history.append(Step(space.dim, float(errors.max())))
        least = min(step.error for step in history)
        best = surface if history[-1].error == least else best
        coarse = space.cells[:, 0] < max_level
        below.append(float(errors[coarse].max(initial=0)))
        outcome = _outcome(least, below, tolerance)
        if outcome is None:
            finer = _finer(space, space.cells[coarse & (errors > tolerance)])
            if finer is None:
                outcome = "max level"
            elif finer.dim > MOST_FUNCTIONS:
                outcome = "too large"
            else:
                try:
                    space, surface = finer, approximate(finer)
                except Underdetermined:
                    outcome = "too few samples"
        if outcome is not None:
            return Fit(best, least, outcome, tuple(history))


def _finer(space: THBSpace, cells: Integers) -> THBSpace | None:
    """Return the space with the surroundings of the cells refined; None where they would be too short for
    float64."""
    try:
        return space.refine(surroundings(space, cells))
    except ValueError:
        return None


def _outcome(error: float, below: list[float], tolerance: float) -> Outcome | None:
    """Return the outcome, or None to go on; below : the error of every fit on the cells that may be
    refined."""
    if error <= tolerance:
        return "reached"
    if below[-1] <= tolerance:
        return "max level"
    if len(below) > PATIENCE and min(below[-PATIENCE:]) >= min(below[:-PATIENCE]):
        return "no progress"
    return None


def surroundings(space: THBSpace, cells: Integers) -> dict[int, Integers]:
    """Return {level: cells}: the leaf cells, not finer, that meet the (p // 2, q // 2) neighbours of given
    leaf cells.

    cells : (n, 3) int [level, i, j].  Refining them makes room for functions of the next level around every
        given cell.
    """
    chosen = []
    for level in np.unique(cells[:, 0]).tolist():
        here = cells[cells[:, 0] == level, 1:]
        offsets = [np.arange(-(kv.degree // 2), kv.degree // 2 + 1) for kv in (space.kv_u, space.kv_v)]
        ring = (here[:, None] + np.stack(np.meshgrid(*offsets), axis=-1).reshape(1, -1, 2)).reshape(-1, 2)
        ring = np.unique(
            np.clip(ring, 0, [(kv.spans << level) - 1 for kv in (space.kv_u, space.kv_v)]), axis=0
        )
        centres = (axis.value(level + 1, 2 * k + 1) for axis, k in zip(space.axes, ring.T))
        leaves = space.cells[np.unique(space.locate(*centres))]
        chosen.append(leaves[leaves[:, 0] <= level])
    leaves = np.unique(np.concatenate(chosen), axis=0)
    return {level: leaves[leaves[:, 0] == level, 1:] for level in np.unique(leaves[:, 0]).tolist()}


def _projected(space: THBSpace, function: Function, smoothing: float) -> THBSurface:
    """Return the L2 projection of a function, by Gauss quadrature on the leaf cells."""
    u, v, weights = gauss_points(space)
    return least_squares(space, Samples(u, v, evaluate(function, u, v), weights), smoothing)


def _function_errors(surface: THBSurface, function: Function) -> Floats:
    """Return the greatest error on every leaf cell, (cells,)."""
    space = surface.space
    fractions = ((np.arange(kv.degree + 2) + 0.5) / (kv.degree + 2) for kv in (space.kv_u, space.kv_v))
    u, v = cell_points(space, *fractions)
    difference = surface(u.ravel(), v.ravel()) - evaluate(function, u.ravel(), v.ravel())
    result: Floats = _distance(difference).reshape(u.shape).max(axis=1)
    return result


def _sample_errors(surface: THBSurface, samples: Samples) -> Floats:
    """Return the greatest error at the samples in every leaf cell, (cells,), 0 where there is none."""
    errors = np.zeros(len(surface.space.cells))
    distance = _distance(surface(samples.u, samples.v) - samples.values)
    np.maximum.at(errors, surface.space.locate(samples.u, samples.v), distance)
    return errors


def _distance(difference: Floats) -> Floats:
    result: Floats = np.linalg.norm(difference.reshape(len(difference), -1), axis=1)
    return result
