"""Which workers do the tasks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager

from optics.base.runtime import UserError, usable_cores
from optics.base.workers.local_processes import LocalProcesses, WorkerPool

MOST = 1024  # processes of one machine


@contextmanager
def worker_pool(
    workers: int | None = None, scheduler: str | None = None, tasks: int = MOST
) -> Iterator[WorkerPool]:
    """Yield the workers for `run_tasks`.

    workers : processes of this machine, None for as many as there are cores.
    scheduler : address of a dask scheduler, such as tcp://host:8786, whose workers are taken instead.
    tasks : no more processes start than there are tasks: each has its share of the memory.

    Raises UserError : a number of workers that cannot be, both arguments, or no scheduler answers.
    """
    require_workers(workers, scheduler)
    if scheduler is None:
        count = min(usable_cores() if workers is None else workers, max(tasks, 1))
        with closing(LocalProcesses(count)) as processes:
            yield processes
        return
    from optics.base.workers.dask_cluster import DaskCluster  # loads asyncio, 0.1 s

    try:
        cluster = DaskCluster(scheduler)
    except ImportError as error:
        raise UserError(str(error)) from None
    with closing(cluster):
        yield cluster


def require_workers(workers: int | None, scheduler: str | None) -> None:
    """Raise UserError for a number of workers that cannot be, or where both are given."""
    if scheduler is not None and workers is not None:
        raise UserError("a scheduler has its own workers: give a number of workers or a scheduler, not both")
    if workers is not None and (type(workers) is not int or not 1 <= workers <= MOST):
        raise UserError(f"the number of workers must be a whole number from 1 to {MOST}, got {workers!r}")
