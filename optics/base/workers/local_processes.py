"""Workers that are processes of this machine, one task at a time each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from itertools import count
from typing import Any, NamedTuple, Protocol

from optics.base.runtime import HelperProcess, ProcessEnded, machine_memory


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

        Raises UserError : there is no way to them any more.
        """

    def lost(self, name: str) -> None:
        """Learn that a worker has ended."""


class OneProcess(Executor):
    """An executor of one process.

    A pool of several processes breaks as a whole when one of them is killed, and does not tell by which task.
    """

    def __init__(self) -> None:
        self._process = HelperProcess()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return what a function of a module will return; it is sent by its name, the arguments as they are.

        Raises TypeError : arguments by keyword.
        """
        if kwargs:
            raise TypeError("a task takes arguments by position")
        return self._process.ask(fn.__module__, fn.__qualname__, *args)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the process; tasks that have not begun are cancelled."""
        self._process.stop()


class LocalProcesses:
    """A fixed number of processes; one that ends is replaced.

    All of them together may take the memory of the machine: one that wants more fails, and not another
    program.
    """

    ended: tuple[type[BaseException], ...] = (ProcessEnded,)

    def __init__(self, workers: int) -> None:
        self._memory = machine_memory() // workers
        self._names = map(str, count())
        self._workers: dict[str, Worker] = {}
        for _ in range(workers):
            self._start()

    def present(self) -> Mapping[str, Worker]:
        return self._workers

    def lost(self, name: str) -> None:
        self._workers.pop(name).executor.shutdown()
        self._start()

    def close(self) -> None:
        """End all processes, side by side: each may need a second to listen."""
        with ThreadPoolExecutor(len(self._workers)) as threads:
            list(threads.map(lambda worker: worker.executor.shutdown(), self._workers.values()))

    def _start(self) -> None:
        self._workers[next(self._names)] = Worker(OneProcess(), 1, self._memory)
