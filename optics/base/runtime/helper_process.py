"""Work in other processes, beside this one.

OpenCASCADE and matplotlib hold Python's lock while they load and while they work: in a thread they would stop
what they should run beside.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.reduction import ForkingPickler
from threading import Event
from types import FrameType
from typing import Any

from optics.base.runtime.errors import NumericalError
from optics.base.runtime.garbage import collect_and_give_back, collect_rarely
from optics.base.runtime.lost_interrupts import lost_interrupts_again
from optics.base.runtime.systems import (
    ForkedProcess,
    background_process,
    forks_safely,
    hear_interrupts,
    interrupt,
    interrupts_held,
    obey,
    pipe_end,
)

PROGRAM = "import sys; from optics.base.runtime import serve; serve(*map(int, sys.argv[1:]))"
PATIENCE = 3.0  # seconds; OCCT does not listen while it works, for about one second
TRAVELLING = ("builtins", "optics", "thbcad")  # packages whose exceptions another process can read


class ProcessEnded(NumericalError, RuntimeError):
    """A process ended before it answered; as a rule the system ended it where memory lacked."""


class HelperProcess:
    """A Python process that calls functions for this one, one after the other, as it is asked.

    It ends when this process ends, however that ends, since its pipes close then: see `obey`.  Ctrl-C in
    a terminal does not reach it.

    forked : for one command: begin with the packages that are loaded here, where that is safe; nothing else
        is shared.  See `done`.
    """

    def __init__(self, forked: bool = False) -> None:
        self._process: subprocess.Popen[bytes]
        self._forked = forked and forks_safely()
        self.ended = False  # by `done`
        self._pipe, theirs = Pipe()
        alive, self._alive = Pipe(duplex=False)  # see `obey`
        paths = os.pathsep.join(map(os.path.abspath, sys.path))
        # not before `serve` listens: Python's start would print what Ctrl-C stops
        with interrupts_held(), theirs, alive:
            if self._forked:
                self._process = ForkedProcess(serve, theirs, alive)
            else:
                self._process = background_process(
                    [sys.executable, "-P", "-c", PROGRAM], os.environ | {"PYTHONPATH": paths}, theirs, alive
                )
        self._caller = ThreadPoolExecutor(1)  # a request is only sent once the one before is answered

    def ask(self, module: str, function: str, *arguments: Any) -> Future[Any]:
        """Return what a function of a module will return; an exception that it raises is raised here.

        The arguments are those of now: what is done with them here later does not change the request.
        """
        request = ForkingPickler.dumps((module, function, arguments))
        return self._caller.submit(self._answer, f"{module}.{function}", request)

    def done(self) -> None:
        """End a forked process once it has answered, for its memory; another one waits to be asked again."""
        if self._forked:
            self.ended = True
            self._caller.submit(self._alive.close)
            self._caller.submit(self._process.wait)

    def stop(self) -> None:
        """End the process as Ctrl-C does, so that no half of a file is left, or else without asking.

        A package that is being loaded may swallow the first signal.
        """
        gently = partial(interrupt, self._process, self._alive)
        for ask in (gently, gently, self._process.kill):
            ask()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(PATIENCE)
                break
        self._caller.shutdown(cancel_futures=True)
        self._pipe.close()
        self._alive.close()

    def _answer(self, asked: str, request: memoryview) -> Any:
        try:
            self._pipe.send_bytes(request)
            value, error = self._pipe.recv()
        except (EOFError, OSError):
            code = self._process.wait()
            raise ProcessEnded(
                f"a helper process ended with code {code} in {asked}, as where memory lacks or somebody ends "
                "it; free memory, or use fewer pixels, rays or levels, and run the command again"
            ) from None
        if error is not None:
            raise error
        return value


def answered(request: Future[Any], function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the answer to a request; where it has not begun, the function does it here."""
    return function(*arguments) if request.cancel() else request.result()


@contextmanager
def process_for(work: str, forked: bool = False) -> Iterator[HelperProcess]:
    """Yield the HelperProcess of this one for some work.  forked : as of a new one.

    It is kept for the next time, unless it is `done` or what is done with it fails.
    """
    process = _KEPT.get(work)
    if process is None or process.ended:
        process = _KEPT[work] = HelperProcess(forked)
    try:
        yield process
    except BaseException:
        if _KEPT.get(work) is process:
            del _KEPT[work]
        process.stop()
        raise


_KEPT: dict[str, HelperProcess] = {}


def serve(requests: int, alive: int) -> None:
    """Answer the requests of the process that started this one, until that ends.

    requests, alive : handles of the pipes by which they come, and that closes when it ends.
    """
    obey(alive)
    collect_rarely()
    with (
        suppress(EOFError, OSError, KeyboardInterrupt),
        lost_interrupts_again(lambda: signal.SIGINT),
        pipe_end(requests) as pipe,
    ):
        signal.signal(signal.SIGINT, _stop)  # work in the background inherits no handler
        hear_interrupts()
        while True:
            pipe.send_bytes(_called(pipe.recv_bytes()))
            collect_and_give_back()
    os._exit(0)  # to take the loaded packages down takes longer than some requests


def _called(request: bytes) -> memoryview:
    """Return (what the function returns, None) or (None, what it raises), pickled.

    What cannot be read of the request, or sent of what the function returns, is an error as any other.
    """
    try:
        with _stopped_while_loading():  # arguments, too, may need a package
            module, function, arguments = ForkingPickler.loads(request)
            value = getattr(import_module(module), function)(*arguments)
            return ForkingPickler.dumps((value, None))
    except Exception as error:
        where = "".join(traceback.format_exception(error))
        if isinstance(error, MemoryError):
            error = MemoryError(str(error))  # numpy has its own
        if type(error).__module__.partition(".")[0] in TRAVELLING:
            error.add_note(where)
            with suppress(Exception):  # it holds what cannot be sent
                return ForkingPickler.dumps((None, error))
        return ForkingPickler.dumps((None, RuntimeError(where)))


_STOPPED = Event()


def _stop(number: int, frame: FrameType | None) -> None:
    _STOPPED.set()
    raise KeyboardInterrupt


@contextmanager
def _stopped_while_loading() -> Iterator[None]:
    """Raise the KeyboardInterrupt that a package (OCP, numpy) turns into its own error while it is loaded.

    Its C code may drop the cause, so the handler remembers the signal.
    """
    try:
        yield
    except Exception:
        if _STOPPED.is_set():
            raise KeyboardInterrupt from None
        raise


def load(module: str, name: str) -> None:
    """Load what a function of a module needs, before it is asked for."""
    getattr(import_module(module), name)
