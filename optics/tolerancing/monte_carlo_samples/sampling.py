"""Monte Carlo samples traced by workers, each with all of its errors at once."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from itertools import chain
from operator import add
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from optics.base.runtime import grade, load_backend
from optics.base.workers import WorkerPool, run_tasks
from optics.light.analysis import delivered, delivery_checks
from optics.light.blur import spot_rms
from optics.scene.system import System
from optics.tolerancing.monte_carlo_samples.random_errors import REPLICATES, Draw, FormTolerance, draws
from optics.tolerancing.monte_carlo_samples.sample_batch import SampleBatch
from optics.tolerancing.perturbations import NOMINAL, Perturbation, PerturbedLight, Tolerance

FIELDS = 4  # form errors, with both signs, whose mean rise of rel_l2^2 is told: they differ by some per cent


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """A design, and how wrong a lens made of it may be.

    target : the light asked for, (rows, columns), at any scale.  floats : the target follows the light.
    """

    system: System
    target: NDArray[np.float64]
    tolerances: tuple[Tolerance, ...]
    forms: tuple[FormTolerance, ...] = ()
    floats: bool = False

    @cached_property
    def light(self) -> PerturbedLight:
        """What traces the lenses, on one thread; every worker builds its own."""
        return PerturbedLight(self.system, load_backend("double", 1), floats=self.floats)

    @cached_property
    def blur(self) -> float:
        """Of the light behind the designed lens, see `blur.spot_rms`; 0 where no verdict needs it."""
        if self.system.target.uniform_region is None:
            return 0.0
        return spot_rms(self.system, self.light.backend)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is sent to workers: all but the device's part."""
        return {name: value for name, value in self.__dict__.items() if name != "light"}

    def errors(self, draw: Draw) -> Perturbation:
        """Return the errors of a lens.

        Raises UserError : see `FormTolerance.drawn`.
        """
        moved = (t.at(a * t.amount) for t, a in zip(self.tolerances, draw.amounts, strict=True))
        return reduce(add, chain(moved, (draw.sign * form for form in self.form(draw.seed))), NOMINAL)

    def form(self, seed: int) -> list[Perturbation]:
        """Return random form errors of the surfaces.  seed : of all of them."""
        seeds = np.random.default_rng(seed).integers(1 << 63, size=len(self.forms))
        return [form.drawn(self.system, int(s)) for form, s in zip(self.forms, seeds)]

    def irradiance(self, draw: Draw) -> NDArray[np.float64]:
        """Return the light of a lens, (rows, columns)."""
        return self.light(self.errors(draw))[0]


class Traced(NamedTuple):
    """What a worker says of a lens.  made, min_over_mean : as of a SampleBatch, NaN of other light."""

    rel_l2: float
    efficiency: float
    made: float
    min_over_mean: float


class Sampled(NamedTuple):
    """The light of Monte Carlo samples.

    sets : their errors, in the order of the batch.
    by_form : rel_l2^2, mean of lenses with nothing but form errors; None without such errors.
    """

    batch: SampleBatch
    sets: list[list[Draw]]
    by_form: float | None


def traced(model: ErrorModel, draw: Draw) -> Traced:
    """Return the quality of the light of one lens, rel_l2 without the noise of counted rays."""
    light, _ = model.light.estimate(model.errors(draw))
    metrics = delivered(model.system, light, model.blur)
    # the most likely values count: what is uncertain of one lens evens out over many
    checks = delivery_checks(metrics, model.system.problem.verify)
    found = grade(replace(check, error=0.0) for check in checks)
    made = np.nan if found == "not decided" else float(found == "made")
    least = metrics.get("uniformity", {}).get("min_over_mean")
    return Traced(metrics["rel_l2_debiased"], metrics["efficiency"], made, np.nan if least is None else least)


def sample_lenses(
    model: ErrorModel, samples: int, pool: WorkerPool, progress: Callable[[int, int], None] | None = None
) -> Sampled:
    """Return the light of `samples` lenses made with errors at random.

    samples : see `draws`.  progress : called with the number of lenses that are done, and of all.

    Raises UserError : another number of samples, a form error that the surface cannot have, or no workers.
    """
    sets = draws(len(model.tolerances), samples, model.system.problem.run.seed)
    model.form(0)  # refuses bands before any worker starts
    # lenses with nothing but form errors, each with both signs: what changes sign has no mean
    right = (0.0,) * len(model.tolerances)
    fields = range(FIELDS if model.forms else 0)
    alone = [Draw(right, seed, sign) for seed in fields for sign in (1.0, -1.0)]
    items = [*alone, *chain.from_iterable(sets)]
    found = np.full((len(items), 4), (np.inf, 0.0, 0.0, 0.0))
    failures: dict[str, None] = {}
    seconds = 0.0
    with closing(run_tasks(traced, items, pool, model)) as results:
        for done, result in enumerate(results, 1):
            if result.failure:
                failures[result.failure] = None
            else:
                found[result.index] = result.value
            seconds += result.seconds
            if progress:
                progress(done, len(items))
    rel, efficiency, made, least = found[len(alone) :].T.reshape(4, REPLICATES, -1)
    uniform = model.system.target.uniform_region is not None
    by_form = float(np.square(found[: len(alone), 0]).mean()) if alone else None
    batch = SampleBatch(rel, efficiency, made, tuple(failures), seconds, least if uniform else None)
    return Sampled(batch, sets, by_form)
