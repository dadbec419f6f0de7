"""What the task loop asks of a pool of workers."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from typing import NamedTuple, Protocol


class Worker(NamedTuple):
    """One worker.

    executor : does the tasks in the order in which they came.  threads : tasks that it does at a time.
    memory : bytes that it may take, 0 where others see to that.
    """

    executor: Executor
    threads: int = 1
    memory: int = 0


class WorkerPool(Protocol):
    """Workers, which may come and go while tasks run.

    ended : exceptions of a future whose worker ended before the task did.
    """

    ended: tuple[type[BaseException], ...]

    def present(self) -> Mapping[str, Worker]:
        """Return the workers that there are now, by a name that no later worker bears.

        Raises
        ------
        UserError : there is no way to them any more.
        """

    def lost(self, name: str) -> None:
        """Learn that a worker has ended."""
