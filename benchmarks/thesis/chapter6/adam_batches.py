"""The thesis's method for a lens, run with this project's tracer: batches of Adam steps between refinements.

Every batch minimises ||E - T|| / ||T|| on the target's pixels, measured in a Gaussian window (5.4); see
`Misfit`.  After it the cells with Z > alpha mean(Z) are refined, where Z sums |dL/dz| over the vertices of a
cell (6.2, 6.3).  The last iterate of a batch goes on, and Adam starts anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

import optics
from benchmarks.thesis.lens_runs import Misfit, Training, trained, unfiltered_target
from optics.base.runtime import load_backend
from optics.designing.optimisation import mark, vertex_knots
from optics.designing.starts import summed_over_cells
from optics.interface.api import System
from optics.light.engines import Engine, ExactEngine
from thbcad import Lens, THBSurface
from thbcad.hierarchy import THBSpace

Floats = NDArray[np.float64]
Marking = Callable[[THBSpace, Floats, int], float]  # space, Z of its cells, greatest level -> alpha

RAYS = (513, 513)  # two per pixel in each direction
VERTICES = 449  # in each direction, of Table 6.1
EQUAL = 1e-9  # of the mean: indicators closer than that belong to mirrored cells, and are marked together
EVERYWHERE, NOWHERE = -1.0, np.inf  # alphas that mark every cell, and none


@dataclass(frozen=True)
class Plan:
    """How a lens is optimised.

    steps : of Adam, one per batch.  marking : of the cells to refine.  filtered : the target is measured in
    the window as the light is.  first_level : of the first batch, everywhere.  noise : standard deviation of
    the indicators, relative, as random rays bring it.  engine : None is the exact tracer with hard rims.
    """

    steps: tuple[float, ...]
    marking: Marking
    iterations: int = 250
    filtered: bool = False
    first_level: int = 0
    noise: float = 0.0
    rays: tuple[int, int] = RAYS
    vertices: int = VERTICES
    engine: Engine | None = None


@dataclass(frozen=True, eq=False)
class Batch:
    """What a batch ended with.

    lens : nothing proves that it can exist.  before, sag : of the batch's start and end.  loss : at the end.
    irradiance : in the window, (rows, columns), W/mm^2.  vertices : |dL/dz| of the vertices, (nx, ny), 1/mm.
    indicator : Z of the leaf cells.  alpha : of the refinement that follows.
    """

    lens: Lens
    before: THBSurface
    sag: THBSurface
    training: Training
    loss: float
    irradiance: Floats
    vertices: Floats
    indicator: Floats
    alpha: float


def adam_batches(system: System, plan: Plan) -> Iterator[Batch]:
    """Yield every batch of a system with a free rear and a fixed front."""
    engine = plan.engine or ExactEngine(load_backend("double", system.problem.run.threads), soft_rim=0.0)
    bound = system.freeforms[-1].freedom
    space = system.space(plan.first_level)
    sag = THBSurface(space, np.zeros(space.dim))
    for level, step in enumerate(plan.steps, plan.first_level):
        model = system.model(sag.space, rays=plan.rays, window="gaussian", engine=engine)
        loss = Misfit(model, model.target if plan.filtered else unfiltered_target(system), bound)
        training = trained(loss, loss.variables(sag.coefficients), optics.Adam(step), plan.iterations)
        last = level + 1 == plan.first_level + len(plan.steps)
        yield (batch := _ended(system, plan, sag, loss, training, None if last else level + 1))
        if not last:
            sag = batch.sag.refine(mark(sag.space, batch.indicator, batch.alpha, level + 1))


def _ended(
    system: System, plan: Plan, before: THBSurface, loss: Misfit, training: Training, level: int | None
) -> Batch:
    """Return what a batch ended with; `level` is the greatest of the refinement that follows, if any."""
    space, coefficients = before.space, loss.coefficients(training.w)
    sag, irradiance = THBSurface(space, coefficients), loss.model(coefficients)
    difference = irradiance - loss.wanted
    norm, scale = np.linalg.norm(difference), np.linalg.norm(loss.wanted)
    slope = difference / ((norm or 1.0) * scale)
    vertices = np.abs(loss.model.vertex_gradients(coefficients, slope, (plan.vertices,) * 2))
    indicator = cell_sums(space, vertices)
    noise = np.random.default_rng(space.dim).standard_normal(len(indicator))
    indicator *= np.maximum(1 + plan.noise * noise, 0)
    return Batch(
        lens=system.base.with_sags([sag]),
        before=before,
        sag=sag,
        training=training,
        loss=float(norm / scale),
        irradiance=irradiance,
        vertices=vertices,
        indicator=indicator,
        alpha=NOWHERE if level is None else plan.marking(space, indicator, level),
    )


def cell_sums(space: THBSpace, vertices: Floats) -> Floats:
    """Return Z of (6.2) of every leaf cell, (n_cells,)."""
    knots = vertex_knots((space.kv_u.stop, space.kv_v.stop), vertices.shape)
    return summed_over_cells(space, *(kv.greville() for kv in knots), vertices)


def everywhere(space: THBSpace, indicator: Floats, level: int) -> float:
    """Return the alpha that refines every cell: uniform bisection of the knot spans."""
    return EVERYWHERE


def same_alpha(alpha: float) -> Marking:
    """Return a marking by one alpha."""
    return lambda space, indicator, level: alpha


def near_dof(row: tuple[int, ...]) -> Marking:
    """Return a marking that lands nearest to the degrees of freedom of every level, row[level]."""
    return partial(_alpha_near, row)


def _alpha_near(row: tuple[int, ...], space: THBSpace, indicator: Floats, level: int) -> float:
    """Return the alpha whose refinement has the degrees of freedom nearest to row[level].

    More cells never have fewer of them, so that halving finds the place.
    """
    share = np.sort(indicator / indicator.mean())[::-1]
    gaps = np.flatnonzero(share[:-1] - share[1:] > EQUAL)
    alphas = [share[0] + 1, *((share[gaps] + share[gaps + 1]) / 2), EVERYWHERE]  # more and more cells

    def dof(k: int) -> int:
        return space.refine(mark(space, indicator, alphas[k], level)).dim

    low, high = 0, len(alphas) - 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if dof(middle) <= row[level] else (low, middle)
    return float(min((alphas[low], alphas[high]), key=lambda a: abs(dof(alphas.index(a)) - row[level])))


# what other benchmarks compare designs with: light and target filtered alike
BOTH_FILTERED = Plan(tuple(0.03 * 0.5**k for k in range(6)), same_alpha(0.1), filtered=True)
