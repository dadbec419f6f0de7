"""Workers of a dask.distributed cluster that runs already."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Executor, Future
from typing import TYPE_CHECKING, Any

from optics.base.runtime import UserError
from optics.base.workers.local_processes import Worker
from optics.base.workers.worker_side import UnpreparedError
from thbcad.doors import loaded

if TYPE_CHECKING:
    from distributed import Client

# they would print tracebacks, until after the end, of a lost scheduler, which is told in one sentence
LOGS = ("distributed", "distributed.client", "distributed.core", "tornado.application", "asyncio")
PATIENCE = 10.0  # seconds in which a scheduler answers: a busy one needs less than one


class _OneWorker(Executor):
    """An executor of one worker.  That of distributed calls an answer an error if its worker ends then."""

    def __init__(self, client: Client, address: str) -> None:
        self._client, self._address = client, address

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return what a function will return; cancelled with it, a task that waits is not begun."""

        async def answered() -> Any:
            try:
                return await task
            except asyncio.CancelledError:
                await task.cancel()
                raise

        # pure: the same task of two runs is two tasks
        task = self._client.submit(fn, *args, workers=[self._address], pure=False, **kwargs)
        loop: Any = self._client.loop  # of tornado, around asyncio's
        return asyncio.run_coroutine_threadsafe(answered(), loop.asyncio_loop)


class DaskCluster:
    """The workers of a scheduler.  Each is its own executor, so that it is known what a killed one did.

    Raises ImportError : dask.distributed is not installed.
    Raises UserError : no scheduler answers.
    """

    def __init__(self, scheduler: str) -> None:
        distributed = loaded("distributed")
        # a client that has lost its scheduler looks for it for so long
        loaded("dask").config.set({"distributed.comm.timeouts.connect": f"{PATIENCE} s"})
        self.ended: tuple[type[BaseException], ...] = (
            distributed.KilledWorker,
            CancelledError,
            asyncio.CancelledError,
            OSError,  # of a connection: what a task raises is a sentence of its answer
            UnpreparedError,
        )
        self._scheduler, self._workers = scheduler, dict[str, Worker]()
        for name in LOGS:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        try:
            self._client: Client = distributed.Client(scheduler, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError, AssertionError) as error:  # the last where its thread starts too late
            reason = " ".join(str(error).split()) or type(error).__name__
            raise UserError(
                f"no dask scheduler answers at {scheduler} ({reason}); start one with `dask scheduler`"
            ) from None

    def present(self) -> Mapping[str, Worker]:
        threads = self._threads()
        for gone in self._workers.keys() - threads.keys():
            del self._workers[gone]
        for address, count in threads.items():
            if address not in self._workers:
                self._workers[address] = Worker(_OneWorker(self._client, address), count)
        return self._workers

    def lost(self, name: str) -> None:
        self._workers.pop(name, None)

    def close(self) -> None:
        self._client.close(timeout=PATIENCE)

    def _threads(self) -> dict[str, int]:
        """Return the number of threads of every worker, as the scheduler knows it now."""
        try:
            if self._client.status != "running":
                raise OSError
            return dict(self._client.nthreads())
        except (OSError, TimeoutError, CancelledError, asyncio.CancelledError):
            raise UserError(
                f"the dask scheduler at {self._scheduler} does not answer any more; start scheduler and "
                "workers again"
            ) from None
