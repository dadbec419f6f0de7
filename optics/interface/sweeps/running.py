"""A sweep from the ranges of its keys to the files that show it: variants that are not stored yet are
computed by workers and stored as they come.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
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


def compute(
    keys: Sequence[str],
    variants: Sequence[Variant],
    shared: Shared,
    keep_lenses: bool,
    pool: WorkerPool,
    store: SweepStore,
    progress: SweepProgress,
) -> None:
    """Compute variants and store a row for each.  keep_lenses : the store keeps lenses too.

    Raises UserError : there are no workers any more; what is stored stays.
    """
    items = (Work(dict(zip(keys, variant.values)), keep_lenses) for variant in variants)
    try:
        with closing(run_tasks(designed, items, pool, shared)) as results:
            for result in results:
                made = result.value or Designed({}, b"", "")
                status = KILLED if result.killed else FAILED if result.failure else DONE
                variant, spent = variants[result.index], (result.seconds, result.peak_mb)
                row = SweepRow(variant.values, status, result.failure, made.metrics, *spent, made.picture)
                store.add(variant.identity, dict(zip(keys, variant.values)), row, made.lens)
                progress.count(bool(result.failure))
    except UserError as error:
        stored = (
            f"{progress.done} of {len(variants)} variants were stored, the same command with --resume goes on"
        )
        if not store.problems():
            stored = "no variant was stored, so that the same command begins anew"
        raise UserError(f"{error}; {stored}") from None


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

    def __exit__(self, *error: object) -> None:
        if error[0] is None:
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
    resume : the folder must hold this sweep.  force : what it holds is replaced.
    keep_lenses : the store keeps the lens of every variant too; what is stored without is designed again.

    Raises UserError : a key or value that no variant can have; a folder of another sweep; no workers.
    """
    if not isinstance(problem, Problem):
        raise UserError(f"sweep takes a Problem, got {problem!r}; optics.load_problem reads a file")
    require_workers(workers, scheduler)
    if keep_lenses and len(problem.free_optics) > 1:
        names = " and ".join(optic.table for optic in problem.free_optics)
        raise UserError(
            f"a sweep keeps the lens of one free element, got {names}; leave the lenses out, and design the "
            "variants that are wanted"
        )
    variants, folder, keys = all_variants(problem, checked_ranges(ranges)), Path(out), tuple(ranges)
    with taken_folder(folder, problem, keys, resume, force) as store:
        missing = _missing(variants, store.done(keep_lenses))
        with SweepProgress(progress, len(missing)) as shown:
            if missing:
                paths = {path for variant in missing for path in variant.files}
                shared = Shared(problem, {path: Path(path).read_bytes() for path in paths})
                with worker_pool(workers, scheduler, len(missing)) as pool:
                    compute(keys, missing, shared, keep_lenses, pool, store, shown)
            shown.tables()
            found = Sweep(folder, keys, [_row(variant, store) for variant in variants])
            write_sweep(found, problem.title)
    return found


def _missing(variants: Iterable[Variant], done: set[str]) -> list[Variant]:
    """Return the variants to compute: of several with the same problem the first."""
    wanted = {variant.identity: variant for variant in reversed(list(variants)) if variant.identity}
    return [variant for identity, variant in reversed(wanted.items()) if identity not in done]


def _row(variant: Variant, store: SweepStore) -> SweepRow:
    held = store.get(variant.identity, variant.values) if variant.identity else None
    return held or SweepRow(variant.values, INVALID, variant.refusal)
