"""One run at a time in a result folder.

The system lets go of the lock when the process ends, however that ends.  With POSIX it is `flock` on a file:
readers share it, and the file says who holds it.  Elsewhere it is the exclusive lock of `filelock`, and to
ask for it is to hold it for a moment.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

from optics.base.runtime import POSIX, UserError, flocked

LOCK = ".lock"
MOST_BYTES = 1000  # of what a lock says
LONGER = 1.0  # seconds, than anybody takes to ask


@contextmanager
def run_lock(folder: Path, title: str) -> Iterator[None]:
    """Hold the lock of a folder; the file says which run holds it, and goes away with the run.

    Raises UserError : another run holds it.
    """
    if not POSIX:
        with _exclusive(folder):
            yield
        return
    path = folder / LOCK
    handle = _locked(path)
    try:
        os.ftruncate(handle, 0)
        os.write(handle, f"process {os.getpid()}, {title!r}".encode()[:MOST_BYTES])
        yield
    finally:
        try:
            path.unlink(missing_ok=True)
        finally:
            os.close(handle)


def require_no_run(folder: Path) -> None:
    """Raise UserError while a run writes to the folder."""
    if not POSIX:  # nobody ever locked it, or who asks may not write
        with _exclusive(folder) if os.access(folder / LOCK, os.W_OK) else nullcontext():
            return
    try:
        handle = os.open(folder / LOCK, os.O_RDONLY)
    except OSError:  # nobody ever locked it
        return
    try:
        _require_flock(handle, folder, shared=True)
    finally:
        os.close(handle)


def _locked(path: Path) -> int:
    """Return the handle of the lock file, locked."""
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _require_flock(handle, path.parent)
            if path.exists() and os.path.samestat(path.stat(), os.fstat(handle)):
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)  # the run before removed the file between the two calls


def _require_flock(handle: int, folder: Path, shared: bool = False) -> None:
    if not flocked(handle, shared):
        raise _held(folder, os.read(handle, MOST_BYTES).decode("utf-8", "replace"))


@contextmanager
def _exclusive(folder: Path) -> Iterator[None]:
    from filelock import FileLock, Timeout  # POSIX does without

    try:
        held = FileLock(folder / LOCK).acquire(timeout=LONGER)
    except Timeout:
        raise _held(folder, "another process") from None
    with held:
        yield


def _held(folder: Path, holder: str) -> UserError:
    return UserError(
        f"another run writes to {folder} ({holder}); wait until it ends, or choose another --out"
    )
