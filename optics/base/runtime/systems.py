"""What operating systems do in their own ways: the one place that asks what this one offers.

The tests run on Linux, there also without `fcntl`, `resource` and the signals of POSIX.  What only Windows or
macOS does was never run.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from glob import glob
from multiprocessing import connection
from pathlib import Path
from threading import Thread, main_thread
from typing import Any, cast

try:
    import fcntl
    import resource
except ImportError:  # Windows
    POSIX = False
else:
    POSIX = True

pipe_end = getattr(connection, "PipeConnection", connection.Connection)  # of a handle; the first on Windows


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def limited_cores(most: int) -> Iterator[None]:
    """Let this thread, and processes that it starts, use so many cores in the block.

    Only Linux can: elsewhere this does nothing.
    """
    if sys.platform != "linux":
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:most])
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


# ---- memory ----


def address_limit() -> int | None:
    """Return how many bytes of addresses this process may take, None for any."""
    if POSIX and sys.platform != "win32":
        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        return None if limit == resource.RLIM_INFINITY else limit
    return None


def limit_memory(most: int) -> None:
    """Let this process take so many bytes of data.

    Windows grants no more than it has, so that nobody else fails for want of it: there this does nothing.
    """
    if POSIX and sys.platform != "win32":
        resource.setrlimit(resource.RLIMIT_DATA, (most, resource.RLIM_INFINITY))


def machine_memory() -> int:
    """Return the bytes of memory of this machine."""
    import psutil  # few commands ask

    return int(psutil.virtual_memory().total)


def peak_mb() -> float:
    """Return the most memory that this process held at a time, MB.

    Linux writes it in /proc.  `getrusage` begins with what the process held that started this one; its unit
    is the byte on macOS, else 1024 of them.
    """
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text("utf-8").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    if POSIX and sys.platform != "win32":
        unit = 1024**2 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
    import psutil  # few commands ask

    return float(psutil.Process().memory_info().peak_wset / 1024**2)


# ---- files ----


def flocked(handle: int, shared: bool = False) -> bool:
    """Lock an open file, which POSIX can, without waiting; return False where others hold it."""
    if POSIX and sys.platform != "win32":
        try:
            fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True


# ---- signals and processes ----


def interrupt_main(number: int) -> None:
    """Send this process a signal that wakes its main thread."""
    if POSIX and sys.platform != "win32":
        signal.pthread_kill(cast(int, main_thread().ident), number)
    else:
        signal.raise_signal(number)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Let Ctrl-C wait, here and in processes that the block starts, in these until `hear_interrupts`."""
    if POSIX and sys.platform != "win32":
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    else:
        yield


def hear_interrupts() -> None:
    """Let come what `interrupts_held` holds."""
    if POSIX and sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def background_process(
    command: Sequence[str], environment: Mapping[str, str], *pipes: Any
) -> subprocess.Popen[bytes]:
    """Start a process without input and output, which no Ctrl-C in a terminal reaches.

    pipes : ends that it inherits; their handles follow the arguments of the command.
    """
    handles = [pipe.fileno() for pipe in pipes]
    options: dict[str, Any]
    if sys.platform == "win32":
        for handle in handles:
            os.set_handle_inheritable(handle, True)
        group = subprocess.CREATE_NEW_PROCESS_GROUP
        info = subprocess.STARTUPINFO(lpAttributeList={"handle_list": handles})
        options = {"creationflags": group, "startupinfo": info}
    else:
        options = {"process_group": 0, "pass_fds": handles}
    nowhere = subprocess.DEVNULL
    words = [*command, *map(str, handles)]
    return subprocess.Popen(words, env=environment, stdin=nowhere, stdout=nowhere, **options)


def forks_safely() -> bool:
    """Return whether a copy of this process would work: another thread's locks would stay locked in it."""
    return POSIX and sys.platform == "linux" and len(glob("/proc/self/task/*")) == 1


class ForkedProcess(subprocess.Popen[bytes]):
    """A copy of this process in the background, as `background_process` starts one, with what is loaded here.

    work : what it does, with the handles of the pipes; it holds no other file of this process.
    """

    def __init__(self, work: Callable[..., object], *pipes: Any) -> None:
        self._work, self._handles = work, [pipe.fileno() for pipe in pipes]
        super().__init__(["a copy of this process"])

    def _execute_child(self, *_: Any) -> None:
        """Copy this process, where Popen would start a program; signals and exit codes are as of one."""
        if sys.platform != "win32":
            self.pid = os.fork()
            self._child_created = True
            if self.pid == 0:
                try:
                    os.setpgid(0, 0)
                    _leave_the_first(self._handles)
                    self._work(*self._handles)
                finally:
                    os._exit(1)


def _leave_the_first(handles: Sequence[int]) -> None:
    """Let a copy of a process share nothing with it but some handles and where messages go."""
    sys.stderr = sys.__stderr__
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 0)
    os.dup2(nowhere, 1)
    for handle in map(int, os.listdir("/proc/self/fd")):
        if handle > 2 and handle not in handles:
            with suppress(OSError):  # that of the list
                os.close(handle)


def interrupt(process: subprocess.Popen[bytes], alive: Any) -> None:
    """Interrupt a process as Ctrl-C does.  alive : the other end of the pipe that it obeys."""
    if POSIX:
        process.send_signal(signal.SIGINT)
    else:
        with suppress(OSError):  # it has ended
            alive.send_bytes(b"stop")


def obey(alive: int) -> None:
    """End this process when the other end of a pipe closes, and interrupt it when something comes.

    On Linux the kernel ends it: OCCT holds Python's lock for seconds, and neither a thread nor a handler of
    Python would see it before.  Elsewhere a thread does, once it gets the lock.
    """
    if POSIX and sys.platform == "linux":
        signal.signal(signal.SIGIO, signal.SIG_DFL)  # which ends the process
        if callable(signal.getsignal(signal.SIGTERM)):  # a copy has the handler of the first process
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
        fcntl.fcntl(alive, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(alive, fcntl.F_SETFL, os.O_NONBLOCK | os.O_ASYNC)
    else:
        Thread(target=_obey, args=(pipe_end(alive),), daemon=True).start()


def _obey(alive: Any) -> None:
    with suppress(EOFError, OSError):
        while alive.recv_bytes():
            interrupt_main(signal.SIGINT)
    os._exit(0)
