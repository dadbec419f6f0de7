"""A search that ends after a number of evaluations, and the lens on which optimisers and constraints run."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

import optics
from benchmarks.checkout import EXAMPLES
from benchmarks.thesis.lens_runs import unfiltered_target
from optics.interface.api import Model, System
from thbcad import THBSpace

Floats = NDArray[np.float64]
Loss = Callable[[Floats], tuple[float, Floats]]

PIXELS = {True: 64, False: 256}
RAYS = {True: 129, False: 513}  # in each direction
LEVEL = {True: 0, False: 2}  # 5 and 20 spans: 10 x 10 and 25 x 25 control points


@dataclass(frozen=True, eq=False)
class Bench:
    """The lens of the study: flat at the start, a square top hat as the target.

    target : not filtered, (rows, columns), W/mm^2.  bound : z_freedom, mm.
    """

    system: System
    space: THBSpace
    model: Model
    target: Floats
    bound: float


@cache
def bench(quick: bool) -> Bench:
    """Return the lens."""
    problem = optics.load_problem(EXAMPLES / "thesis" / "optimisers.toml")
    system = optics.System(problem.with_(**{"target.pixels": (PIXELS[quick], PIXELS[quick])}))
    space = system.space(LEVEL[quick])
    model = system.model(space, (RAYS[quick], RAYS[quick]))
    model.vjp(np.zeros(space.dim))  # kernels are compiled once
    bound = system.problem.lens.rear.freeform.freedom
    return Bench(system, space, model, unfiltered_target(system), bound)


@dataclass(frozen=True, eq=False)
class Search:
    """What an optimiser saw.

    best : variables of the least loss.  losses, seconds : of every evaluation.  steps : of the optimiser.
    """

    best: Floats
    losses: Floats
    seconds: Floats
    steps: int


class _Enough(Exception):
    """The number of evaluations is reached."""


class _Record:
    """A loss that notes what is seen, and ends the search after a number of evaluations."""

    def __init__(self, loss: Loss, start: Floats, evaluations: int) -> None:
        self._loss, self._evaluations, self._begun = loss, evaluations, perf_counter()
        self.best, self.losses, self.seconds = start, list[float](), list[float]()
        self.steps = 0

    def __call__(self, w: Floats) -> tuple[float, Floats]:
        if len(self.losses) == self._evaluations:
            raise _Enough
        value, gradient = self._loss(w)
        if value < min(self.losses, default=np.inf):
            self.best = w.copy()
        self.losses.append(value)
        self.seconds.append(perf_counter() - self._begun)
        return value, gradient

    def stepped(self, _: Floats) -> None:
        self.steps += 1


def searched(loss: Loss, start: Floats, optimiser: optics.Optimiser, evaluations: int) -> Search:
    """Return what an optimiser saw in a number of evaluations; every trial of a line search counts."""
    record = _Record(loss, start, evaluations)
    with suppress(_Enough):
        optimiser.run(record, start, evaluations, record.stepped)
    return Search(record.best, np.array(record.losses), np.array(record.seconds), record.steps)
