"""A sweep from the ranges of its keys to the files that show it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optics.base.runtime import ProgressEvent, UserError
from optics.base.workers import require_workers, worker_pool
from optics.interface.sweeps.computing import SweepProgress, Tasks, compute
from optics.interface.sweeps.sweep_folder import taken_folder, write_sweep
from optics.interface.sweeps.sweep_rows import INVALID, Sweep, SweepRow
from optics.interface.sweeps.sweep_store import SweepStore
from optics.interface.sweeps.variant_work import Designed, Shared, Work, designed
from optics.interface.sweeps.variants import Variant, all_variants, checked_ranges
from optics.scene.problem import Problem


@dataclass(frozen=True)
class SweepPlan:
    """What a sweep shall do.

    ranges : values by key.  workers, scheduler : as `optics.base.workers.worker_pool`.
    resume : the folder must hold this sweep.  force : what it holds is replaced.
    keep_lenses : the store keeps the lens of every variant too; what is stored without is designed again.
    """

    problem: Problem
    ranges: Mapping[str, Sequence[Any]]
    folder: Path
    workers: int | None = None
    scheduler: str | None = None
    resume: bool = False
    force: bool = False
    keep_lenses: bool = False


def sweep(
    problem: Problem,
    ranges: Mapping[str, Sequence[Any]],
    out: str | Path,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: bool | Callable[[ProgressEvent], None] | None = None,
    resume: bool = False,
    force: bool = False,
    keep_lenses: bool = False,
) -> Sweep:
    """Design every combination of the values of some keys, and write tables, plots and a page to a folder.

        optics.sweep(problem, {"target.distance": [200, 300, 400]}, "exports/distances")

    What is designed already is not computed again, so that a sweep which was stopped goes on.  A variant that
    fails is a row with its sentence, and is tried again by the next run.

    workers : processes of this machine, None for as many as cores.  scheduler : address of a dask scheduler
        whose workers are taken instead.
    progress : True draws a bar; a function is called with every `optics.base.runtime.ProgressEvent`.
    resume, force, keep_lenses : see `SweepPlan`.

    Raises
    ------
    UserError : a key or value that no variant can have; a folder of another sweep; no workers.
    """
    if not isinstance(problem, Problem):
        raise UserError(f"sweep takes a Problem, got {problem!r}; optics.load_problem reads a file")
    plan = SweepPlan(problem, ranges, Path(out), workers, scheduler, resume, force, keep_lenses)
    return run_sweep(plan, progress)


def run_sweep(
    plan: SweepPlan,
    progress: bool | Callable[[ProgressEvent], None] | None = None,
    function: Callable[[Shared, Work], Designed] = designed,
) -> Sweep:
    """Run a sweep and return it, see `sweep`.  function : what computes a variant."""
    require_workers(plan.workers, plan.scheduler)
    problem, ranges, keys = plan.problem, checked_ranges(plan.ranges), tuple(plan.ranges)
    variants = all_variants(problem, ranges)
    with taken_folder(plan.folder, problem, keys, plan.resume, plan.force) as store:
        missing = _missing(variants, store.done(plan.keep_lenses))
        with SweepProgress(progress, len(missing)) as shown:
            if missing:
                paths = {path for variant in missing for path in variant.files}
                files = {path: Path(path).read_bytes() for path in paths}
                tasks = Tasks(keys, missing, Shared(problem, files), plan.keep_lenses)
                with worker_pool(plan.workers, plan.scheduler, len(missing)) as pool:
                    compute(tasks, pool, store, shown, function)
            shown.tables()
            found = Sweep(plan.folder, keys, [_row(variant, store) for variant in variants])
            write_sweep(found, problem.title)
    return found


def _missing(variants: Iterable[Variant], done: set[str]) -> list[Variant]:
    """Return the variants to compute: of several with the same problem the first."""
    wanted = {variant.identity: variant for variant in reversed(list(variants)) if variant.identity}
    return [variant for identity, variant in reversed(wanted.items()) if identity not in done]


def _row(variant: Variant, store: SweepStore) -> SweepRow:
    held = store.get(variant.identity) if variant.identity else None
    if held is None:
        return SweepRow(variant.values, INVALID, variant.refusal)
    return SweepRow(variant.values, **held._asdict())
