"""The variants of a sweep that are not stored yet, computed by workers and stored as they come."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from optics.base.runtime import Phase, Progress, ProgressEvent, UserError
from optics.base.workers import WorkerPool, run_tasks
from optics.designing.progress import drawing
from optics.interface.sweeps.sweep_rows import DONE, FAILED, KILLED
from optics.interface.sweeps.sweep_store import StoredVariant, SweepStore
from optics.interface.sweeps.variant_work import Designed, Shared, Work
from optics.interface.sweeps.variants import Variant

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

    Raises
    ------
    UserError : there are no workers any more; what is stored stays.
    """
    items = (Work(tasks.changes(index), tasks.keep_lenses) for index in range(len(tasks.variants)))
    try:
        with closing(run_tasks(function, items, pool, tasks.shared)) as results:
            for result in results:
                made = result.value or Designed({}, b"", "")
                status = KILLED if result.killed else FAILED if result.failure else DONE
                row = StoredVariant(
                    status=status,
                    sentence=result.failure,
                    metrics=made.metrics,
                    seconds=result.seconds,
                    peak_mb=result.peak_mb,
                    picture=made.picture,
                )
                store.add(tasks.variants[result.index].identity, tasks.changes(result.index), row, made.lens)
                progress.count(bool(result.failure))
    except UserError as error:
        raise UserError(
            f"{error}; {progress.done} of {len(tasks.variants)} variants were stored, the same command goes "
            "on with the rest"
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
