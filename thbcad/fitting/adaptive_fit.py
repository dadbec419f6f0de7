"""Adaptive fitting of functions and samples to a tolerance.

Source: C. Giannelli, B. Juettler, H. Speleers, THB-splines, CAGD 29 (2012), section 6; G. Kiss et al.,
Adaptive CAD model (re-)construction with THB-splines, Graphical Models 76 (2014).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from thbcad.checks import Bools, Integers, read_only, require_integer, require_number, require_type
from thbcad.fitting.fit_targets import HELD_OUT, OfFunction, OfSamples
from thbcad.fitting.least_squares_fit import Samples, require_smoothing
from thbcad.fitting.normal_equations import Underdetermined
from thbcad.fitting.smoothing_choice import Smoothing
from thbcad.hierarchy import MAX_LEVEL, THBSpace
from thbcad.splines import Function
from thbcad.surfaces import THBSurface
from thbcad.values import Value

WORTH = 0.99  # one per cent less: refinement takes that much from the rms of noise by chance
PATIENCE = 3  # refinements without a smaller error: the cells at fault are then 8 times smaller
MOST_FUNCTIONS = 300_000

Outcome = Literal[
    "reached", "noise", "max level", "no progress", "too few samples", "too large", "smallest cells"
]


class Step(NamedTuple):
    """Degrees of freedom, greatest error, and root mean square error at points beside the fitted ones."""

    dim: int
    error: float
    rms: float


@dataclass(frozen=True, eq=False)
class Fit(Value):
    """The best fit, and how the search ended.

    error : greatest error of the surface: a bound, or the greatest where it was measured.
    certified : whether the error is a bound that holds everywhere, rounding included.
    rms : root mean square of the error at points that it was not fitted to: samples held out; for a function
        the points of the error, weighted by area.
    outcome : how the search ended.

        - "reached": the error is at most the tolerance.
        - "noise": neighbouring samples differ independently from the surface, and the last refinement lowered
          the rms by less than 1 %.  What is left is noise, or finer than the samples.
        - "max level": no cell above the tolerance may be refined further.
        - "no progress": three refinements lowered the error (of samples: the rms) by less than 1 %.  Seen at
          jumps, and with too much smoothing.
        - "too few samples": the next space has more functions than samples that are fitted, or they do not
          determine it.
        - "too large": the next space has more than 300,000 functions.
        - "smallest cells": float64 cannot halve the cells above the tolerance.

    history : one Step for every fit, coarsest first.
    outliers : numbers of the samples that a robust fit takes for outliers, (n,) int; error and rms are those
        of the others.

    >>> kv = KnotVector.uniform(degree=3, spans=4)
    >>> found = fit(THBSpace(kv, kv), lambda u, v: np.exp(-50 * (u**2 + v**2)), tolerance=1e-3)
    >>> found.outcome, found.error <= 1e-3, found.surface.space.levels > 1
    ('reached', True, True)
    """

    surface: THBSurface
    error: float
    rms: float
    outcome: Outcome
    history: tuple[Step, ...]
    outliers: Integers
    certified: bool

    def __post_init__(self) -> None:
        vars(self).update(outliers=read_only(self.outliers, np.int64))

    def __repr__(self) -> str:
        error = f"error {'<= ' if self.certified else ''}{self.error:.3g}"
        return (
            f"Fit({self.outcome}, {error}, rms {self.rms:.3g}, {len(self.outliers)} outliers, {self.surface})"
        )


def fit(
    space: THBSpace,
    target: Function | Samples,
    tolerance: float,
    max_level: int = 6,
    smoothing: Smoothing = 0.0,
    robust: bool = False,
    progress: Callable[[Step], object] | None = None,
) -> Fit:
    """Return a spline of this space, refined where needed, that differs from the target by at most
    `tolerance`.

    Fits by least squares, measures the error on every leaf cell, refines the cells above the
    tolerance together with their neighbours (`surroundings`), and so on.

    A function is sampled for the fit at (p + 1)(q + 1) Gauss points of every leaf cell, weighted by
    area (the L2 projection), and for the error at (p + 2)(q + 2) other points.  Of given samples of
    positive weight a random third (the same in every call) is held out of the fit; the error is measured
    at all of them, but not at the outliers of a robust fit, those whose `robust_weights` are 0.  It is no
    bound: what lies between the points is not seen.  Of a B-spline or THB surface and of a `BoundedFunction`,
    such as a conic, it is one.

    If the tolerance is not reached, the best fit is that of least error for a function, and for samples that
    of least rms.

    target : a function of u and v, (n,) float each, that returns (n,) or (n, d); a spline surface; samples
    tolerance : greatest distance |s - target|, in the unit of the target
    max_level : cells of this level are not refined, 0 to 24
    smoothing, robust : as in `least_squares`; chosen smoothing and robust weights need samples
    progress : called with the Step of every fit

    Raises ValueError : a tolerance that is not positive, a level outside 0..24, fewer than three samples of
        positive weight, function values that are not finite.
    Raises Underdetermined : the samples do not determine a spline of the given space.
    """
    require_type("space", space, THBSpace)
    require_number("tolerance", tolerance, above=0)
    require_integer("max_level", max_level, 0, MAX_LEVEL)
    require_smoothing(smoothing)
    require_type("robust", robust, bool)
    show = progress or (lambda step: None)
    if isinstance(target, Samples):
        used = np.flatnonzero(target.weights > 0)
        if len(used) < HELD_OUT:
            raise ValueError(f"a fit needs at least {HELD_OUT} samples of positive weight, got {len(used)}")
        samples = OfSamples(target[used], smoothing, robust)
        found = _refined(space, samples, tolerance, max_level, show)
        return replace(found, outliers=used[found.outliers])
    if robust or isinstance(smoothing, str):
        raise ValueError("a function has no noise: chosen smoothing and robust weights need samples")
    return _refined(space, OfFunction.of(target, smoothing, tolerance), tolerance, max_level, show)


def _refined(
    space: THBSpace,
    target: OfFunction | OfSamples,
    tolerance: float,
    max_level: int,
    show: Callable[[Step], object],
) -> Fit:
    """Return the fit: approximate, measure the error of every leaf cell, refine, until there is an
    outcome."""
    surface = target.fit(space)
    history: list[Step] = []
    ranks: list[float] = []
    below: list[float] = []
    while True:
        check = target.check(surface)
        step = Step(space.dim, float(check.errors.max()), check.rms)
        show(step)
        history.append(step)
        ranks.append(target.rank(check))
        if step.error <= tolerance or ranks[-1] == min(ranks):
            best = surface, step.error, step.rms, check.outliers
        coarse = space.cells[:, 0] < max_level
        below.append(target.loss(check, coarse))
        above = coarse & (check.errors > tolerance)
        outcome = _outcome(step.error <= tolerance, check.noise, bool(above.any()), below)
        finer = outcome or _finer(space, above, target.samples_seen)
        try:
            if isinstance(finer, THBSpace):
                space, surface = finer, target.fit(finer)
                continue
        except Underdetermined:
            finer = "too few samples"
        surface, error, rms, outliers = best
        return Fit(surface, error, rms, finer, tuple(history), outliers, target.certified)


def _finer(space: THBSpace, above: Bools, samples: float) -> THBSpace | Outcome:
    """Return the space with the surroundings of the given cells refined, or why there is none."""
    try:
        finer = space.refine(surroundings(space, space.cells[above]))
    except ValueError:
        return "smallest cells"
    if finer.dim > samples:
        return "too few samples"
    return "too large" if finer.dim > MOST_FUNCTIONS else finer


def _outcome(reached: bool, noise: bool, refinable: bool, below: list[float]) -> Outcome | None:
    """Return the outcome, or None to go on; below : what refinement is to lower, of every fit."""
    if reached:
        return "reached"
    if noise and len(below) > 1 and below[-1] > WORTH * min(below[:-1]):
        return "noise"
    if not refinable:
        return "max level"
    if len(below) > PATIENCE and min(below[-PATIENCE:]) > WORTH * min(below[:-PATIENCE]):
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
