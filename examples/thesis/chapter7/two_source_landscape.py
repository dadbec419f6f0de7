"""Loss landscapes of two equal sources: the best residual by their distance (thesis, Figures 7.7 and 7.8)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from examples.thesis.chapter7.two_deltas import approximate_two_deltas
from optics.base.runtime import NumericalError
from optics.base.workers import run_tasks
from optics.designing.etendue import Approximation
from thbcad.checks import Floats, read_only

if TYPE_CHECKING:
    from optics.base.workers import WorkerPool

PIXELS = 256  # on [-1, 1]: a step of 1/128 is one pixel
SIDE, RADIUS = 0.5, 0.33
STEPS = 20
MARKS = {"square": ((0, 8), (6, 6), (8, 0)), "disk": ((0, 4), (8, 4), (13, 4))}  # (m, n): columns, rows


@dataclass(frozen=True, eq=False)
class Landscape:
    """The certified best residuals ||E * F - G|| / ||G||, by the position of the second source.

    It lies n rows and m columns from the first.

    residual, lower_bound, kkt : (STEPS + 1, STEPS + 1), at [n, m]
    """

    residual: Floats
    lower_bound: Floats
    kkt: Floats


def square(pixels: int = PIXELS, side: float = SIDE) -> Floats:
    """Return the square |x|, |y| <= side / 2 on [-1, 1]^2: 1 in the pixels whose middles lie in it."""
    lit = np.abs(_middles(pixels)) <= side / 2
    return np.outer(lit, lit).astype(np.float64)


def disk(pixels: int = PIXELS, radius: float = RADIUS) -> Floats:
    """Return the disk x^2 + y^2 <= radius^2 on [-1, 1]^2: 1 in the pixels whose middles lie in it."""
    x = _middles(pixels)
    return (np.hypot(x[:, None], x) <= radius).astype(np.float64)


def two_sources(target: Floats, m: int, n: int) -> Approximation:
    """Return the best light for equal sources at the origin and m columns and n rows from it (7.42)."""
    return approximate_two_deltas((n, m), (1.0, 1.0), target)


def landscape(target: Floats, steps: int = STEPS, pool: WorkerPool | None = None) -> Landscape:
    """Return the landscape over m, n = 0 .. steps.

    target : dark in a border of `steps` pixels.  pool : computes the positions side by side, see
        `optics.base.workers.worker_pool`; None computes them here.

    Raises NumericalError : a worker could not compute a position.
    """
    places = list(np.ndindex(steps + 1, steps + 1))
    best = np.array(all_values(_best, places, pool, target)).reshape(steps + 1, steps + 1, 3)
    residual, lower_bound, kkt = np.moveaxis(best, 2, 0)
    return Landscape(read_only(residual), read_only(lower_bound), read_only(kkt))


def all_values(
    function: Callable[[Any, Any], Any],
    items: Iterable[Any],
    pool: WorkerPool | None = None,
    common: Any = None,
) -> list[Any]:
    """Return the value of function(common, item) for every item, in their order.

    pool : does the tasks, see `run_tasks`; None does them here, one after the other.

    Raises NumericalError : a task failed on a worker, with its sentence.
    """
    if pool is None:
        return [function(common, item) for item in items]
    results = sorted(run_tasks(function, items, pool, common), key=lambda result: result.index)
    for result in results:
        if result.failure:
            raise NumericalError(f"task {result.index + 1} of {len(results)} failed: {result.failure}")
    return [result.value for result in results]


def _best(target: Floats, place: tuple[int, int]) -> tuple[float, float, float]:
    """Return residual, lower bound and KKT error.  place : rows and columns to the second source."""
    n, m = place
    one = two_sources(target, m, n)
    return one.residual, one.lower_bound, one.kkt


def _middles(pixels: int) -> Floats:
    return (np.arange(pixels) + 0.5) * 2 / pixels - 1
