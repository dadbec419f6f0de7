"""Tasks handed to workers, a few at a time, until each has its result or the sentence why it has none."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field
from itertools import islice
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any
from uuid import uuid4

from optics.base.runtime import UserError
from optics.base.workers.lack_of_memory import lacks_memory
from optics.base.workers.local_processes import Worker, WorkerPool
from optics.base.workers.messages import COMMON, ITEM, VALUE, packed, unpacked
from optics.base.workers.worker_side import Answer, answer, prepare
from thbcad import __version__

MOST_IN_FLIGHT = 4  # tasks of one thread of a worker: of short ones the next must lie ready
WAITING = 0.5  # seconds of work that may lie ready at a worker; more would be missing elsewhere at the end
TRIES = 2  # of a task whose worker ended
LOOK = 1.0  # seconds between two looks at which workers there are
PATIENCE = 60.0  # seconds without any worker: those of a cluster need some to start again
KILLED = f"its worker ended before it was done, {TRIES} times; perhaps it lacked memory"
BAD_STARTS = 3  # workers one after the other that end before they are ready


@dataclass(frozen=True)
class TaskResult:
    """What came of a task.

    index : of the item.  failure : "" where it succeeded, else a sentence.  seconds : that it took.
    peak_mb : the most memory that its worker has held so far.  killed : its worker ended, twice.
    """

    index: int
    value: Any
    failure: str = ""
    seconds: float = 0.0
    peak_mb: float = 0.0
    killed: bool = False


@dataclass
class _Task:
    index: int
    item: Any
    deaths: int = 0


@dataclass
class _Lane:
    """A worker and the tasks that it has, the oldest first; it gets them once it is ready."""

    worker: Worker
    starting: Future[str]
    ready: bool = False
    tasks: dict[Future[Answer], _Task] = field(default_factory=dict)

    def takes(self, task: _Task, most: int) -> bool:
        """Return whether there is room for a task, where each thread has `most`.

        A task whose worker has ended is alone with the next one: if that ends too, it is known by which task.
        """
        if task.deaths or any(mine.deaths for mine in self.tasks.values()):
            return not self.tasks
        return len(self.tasks) < most * self.worker.threads


def run_tasks(
    function: Callable[[Any, Any], Any], items: Iterable[Any], pool: WorkerPool, common: Any = None
) -> Generator[TaskResult]:
    """Yield the result of function(common, item) for every item, in the order in which they come.

    A task that raises, or that cannot be sent or answered, has a sentence instead of a value.  A task whose
    worker ends is tried once more.

    function : of a module, which workers import.  items : read as they are needed.
    common : sent to every worker once.

    Raises UserError : there are no workers, or no more; they cannot be sent `common`.
    """
    loop = _TaskLoop(function, items, pool, common)
    try:
        yield from loop.results()
    finally:
        loop.cancel()


class _TaskLoop:
    def __init__(
        self, function: Callable[[Any, Any], Any], items: Iterable[Any], pool: WorkerPool, common: Any
    ) -> None:
        self._run, self._name = uuid4().hex, (function.__module__, function.__qualname__)
        self._items, self._pool, self._common = enumerate(items), pool, packed(common, COMMON)
        self._again = deque[_Task]()
        self._lanes: dict[str, _Lane] = {}
        self._events = SimpleQueue[tuple[str, Future[Any]]]()
        self._seconds, self._done = 0.0, 0  # of all tasks
        self._looked, self._seen, self._bad_starts = -LOOK, monotonic(), 0

    def results(self) -> Iterator[TaskResult]:
        while True:
            yield from self._look()
            for most in range(1, self._depth() + 1):  # first to those that have fewest
                for name, lane in self._lanes.items():
                    while lane.ready and self._more() and lane.takes(self._again[0], most):
                        yield from self._hand_out(name, lane)
            if not self._more() and not any(lane.tasks for lane in self._lanes.values()):
                return
            yield from self._wait()

    def cancel(self) -> None:
        """Cancel what has not begun."""
        for lane in self._lanes.values():
            for future in lane.tasks:
                future.cancel()

    def _look(self) -> Iterator[TaskResult]:
        """Learn which workers there are; the tasks of those that are gone go to others."""
        now = monotonic()
        if now < self._looked + LOOK:
            return
        present, self._looked = self._pool.present(), now
        for name in [name for name, lane in self._lanes.items() if present.get(name) is not lane.worker]:
            yield from self._close(name)
        for name, worker in present.items():
            if name not in self._lanes:
                starting = worker.executor.submit(prepare, self._run, self._common, worker.memory)
                self._lanes[name] = _Lane(worker, starting)
                self._listen(name, starting)
        if self._lanes:
            self._seen = now
        elif now > self._seen + PATIENCE:
            raise UserError(f"no worker came for {PATIENCE:.0f} s; start some, such as `dask worker ADDRESS`")

    def _more(self) -> bool:
        """Return whether a task lies ready to be handed out."""
        if not self._again:
            self._again.extend(_Task(index, item) for index, item in islice(self._items, 1))
        return bool(self._again)

    def _hand_out(self, name: str, lane: _Lane) -> Iterator[TaskResult]:
        """Give a worker the next task; where its item cannot be sent, that has failed."""
        task = self._again.popleft()
        try:
            item = packed(task.item, ITEM)
        except UserError as error:
            yield TaskResult(task.index, None, str(error))
            return
        future = lane.worker.executor.submit(answer, self._run, *self._name, item)
        lane.tasks[future] = task
        self._listen(name, future)

    def _depth(self) -> int:
        """Return how many tasks a thread of a worker may have."""
        if not self._done:
            return 1
        return int(min(MOST_IN_FLIGHT, 1 + WAITING * self._done / max(self._seconds, 1e-9)))

    def _listen(self, name: str, future: Future[Any]) -> None:
        future.add_done_callback(lambda over: self._events.put((name, over)))

    def _wait(self) -> Iterator[TaskResult]:
        """Take the futures that are over, at least one unless it takes long."""
        try:
            name, future = self._events.get(timeout=LOOK)
        except Empty:
            return
        lane = self._lanes.get(name)
        if lane is None or (future is not lane.starting and future not in lane.tasks):
            return  # the worker is gone, its tasks were taken then
        if self._ended(future):
            self._bad_starts += future is lane.starting
            if self._bad_starts == BAD_STARTS:
                raise UserError(
                    f"{BAD_STARTS} workers ended while they started; see whether there is memory left for "
                    "them"
                )
            self._pool.lost(name)
            self._looked = -LOOK
            yield from self._close(name)
        elif future is lane.starting:
            _require_version(name, lane.starting)
            lane.ready, self._bad_starts = True, 0
        else:
            yield self._result(future, lane.tasks.pop(future))

    def _ended(self, future: Future[Any]) -> bool:
        """Return whether the worker of a future has ended before its task."""
        return future.cancelled() or isinstance(future.exception(), self._pool.ended)

    def _close(self, name: str) -> Iterator[TaskResult]:
        """Take the tasks of a worker that has ended: what it was at has failed, the rest goes to others."""
        lane = self._lanes.pop(name)
        left = []
        for future, task in lane.tasks.items():
            if future.done() and not self._ended(future):
                yield self._result(future, task)
            else:
                future.cancel()
                left.append(task)
        for task in left[: lane.worker.threads]:
            task.deaths += 1
        for task in reversed(left):
            if task.deaths < TRIES:
                self._again.appendleft(task)
            else:
                yield TaskResult(task.index, None, KILLED, killed=True)

    def _result(self, future: Future[Answer], task: _Task) -> TaskResult:
        error = future.exception()
        if error is not None:  # of what carries tasks and answers
            failure = str(
                UserError(f"the task could not be sent or answered: {type(error).__name__}: {error}")
            )
            return TaskResult(task.index, None, failure)
        said = future.result()
        self._seconds += said.seconds
        self._done += 1
        value, failure = None, said.failure
        if not failure:
            try:
                value = unpacked(said.value, VALUE)
            except UserError as error:
                failure = str(error)
        return TaskResult(task.index, value, failure, said.seconds, said.peak_mb)


def _require_version(name: str, starting: Future[str]) -> None:
    """Raise UserError unless a worker has this version of thbcad, or what it says."""
    if (error := starting.exception()) is not None:
        if isinstance(error, UserError) or lacks_memory(error):
            raise error
        raise UserError(
            f"the worker {name} cannot be made ready ({type(error).__name__}: {error}); install thbcad "
            f"{__version__} there"
        )
    if (version := starting.result()) != __version__:
        raise UserError(
            f"the worker {name} has thbcad {version}, this is {__version__}: install the same there"
        )
