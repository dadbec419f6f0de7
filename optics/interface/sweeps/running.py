"""A sweep from the ranges of its keys to the files that show it: variants that are not stored yet are
computed by workers and stored as they come.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from optics.base.runtime import Phase, Progress, ProgressEvent, UserError
from optics.base.workers import WorkerPool, require_workers, run_tasks, worker_pool
from optics.designing.progress import drawing
from optics.interface.sweeps.sweep_folder import taken_folder, write_sweep
from optics.interface.sweeps.sweep_rows import DONE, FAILED, INVALID, KILLED, Sweep, SweepRow
from optics.interface.sweeps.sweep_store import SweepStore
from optics.interface.sweeps.variant_work import Designed, Shared, Work, designed
from optics.interface.sweeps.variants import Variant, all_variants, checked_ranges
from optics.scene.problem import Problem

VARIANT, TABLES = 3.0, 2.0  # expected seconds: of a variant, and of tables and plots


@dataclass(frozen=True)
class Tasks:
    """What is to be computed.  keys : that are varied.  keep_lenses : the store keeps lenses too."""

    keys: tuple[str, ...]
    variants: Sequence[Variant]
    shared: Shared
    keep_lenses: bool = False

    def changes(self, index: int) -> dict[str, Any]:
        return dict(zip(self.keys, self.variants[index].values))


def compute(
    tasks: Tasks,
    pool: WorkerPool,
    store: SweepStore,
    progress: SweepProgress,
    function: Callable[[Shared, Work], Designed],
) -> None:
    """Compute variants and store a row for each.

    Raises UserError : there are no workers any more; what is stored stays.
    """
    items = (Work(tasks.changes(index), tasks.keep_lenses) for index in range(len(tasks.variants)))
    try:
        with closing(run_tasks(function, items, pool, tasks.shared)) as results:
            for result in results:
                made = result.value or Designed({}, b"", "")
                status = KILLED if result.killed else FAILED if result.failure else DONE
                variant, spent = tasks.variants[result.index], (result.seconds, result.peak_mb)
                row = SweepRow(variant.values, status, result.failure, made.metrics, *spent, made.picture)
                store.add(variant.identity, tasks.changes(result.index), row, made.lens)
                progress.count(bool(result.failure))
    except UserError as error:
        raise UserError(
            f"{error}; {progress.done} of {len(tasks.variants)} variants were stored, the same command with "
            "--resume goes on"
        ) from None


class SweepProgress:
    """How many variants are done and failed.

    show : True draws a bar on stderr, a function is called with every ProgressEvent; None is silent.
    """

    def __init__(self, show: bool | Callable[[ProgressEvent], None] | None, variants: int) -> None:
        if not (show is None or isinstance(show, bool) or callable(show)):
            raise UserError(f"progress must be True, None or a function of a ProgressEvent, got {show!r}")
        self._drawing = drawing(sys.stderr) if show is True else None
        self._show = self._drawing or (show if callable(show) else lambda event: None)
        self._variants, self.done, self.failed = variants, 0, 0

    def __enter__(self) -> SweepProgress:
        phases = [Phase("variants", VARIANT * self._variants + TABLES), Phase("tables", TABLES)]
        self._progress = Progress(phases, self._show)
        if self._drawing:
            self._drawing.keep_alive(self._progress.report)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self._progress.finish()
        if self._drawing:
            self._drawing.close()

    def tables(self) -> None:
        """Say that all variants are over."""
        self._progress.begin("tables")

    def count(self, failed: bool) -> None:
        """Say that a variant is over."""
        self.done += 1
        self.failed += failed
        self._progress.advance(
            self.done / self._variants, f"{self.done} of {self._variants} over, {self.failed} failed"
        )


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

    Raises UserError : a key or value that no variant can have; a folder of another sweep; no workers.
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
    if plan.keep_lenses and len(plan.problem.free_optics) > 1:
        names = " and ".join(optic.table for optic in plan.problem.free_optics)
        raise UserError(
            f"a sweep keeps the lens of one free element, got {names}; leave the lenses out, and design the "
            "variants that are wanted"
        )
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
    held = store.get(variant.identity, variant.values) if variant.identity else None
    return held or SweepRow(variant.values, INVALID, variant.refusal)
