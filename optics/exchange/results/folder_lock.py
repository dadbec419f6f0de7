"""One run at a time in a result folder.

The lock is `flock` on a file: the kernel lets go of it when the process ends, however that ends.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from optics.base.runtime import UserError

LOCK = ".lock"
MOST_BYTES = 1000  # of what a lock says


@contextmanager
def run_lock(folder: Path, title: str) -> Iterator[None]:
    """Hold the lock of a folder; the file says which run holds it, and goes away with the run.

    Raises UserError : another run holds it.
    """
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
    try:
        handle = os.open(folder / LOCK, os.O_RDONLY)
    except OSError:  # nobody ever locked it
        return
    try:
        _lock(handle, fcntl.LOCK_SH, folder)
    finally:
        os.close(handle)


def _locked(path: Path) -> int:
    """Return the handle of the lock file, locked."""
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _lock(handle, fcntl.LOCK_EX, path.parent)
            if path.exists() and os.path.samestat(path.stat(), os.fstat(handle)):
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)  # the run before removed the file between the two calls


def _lock(handle: int, kind: int, folder: Path) -> None:
    try:
        fcntl.flock(handle, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(handle, MOST_BYTES, 0).decode("utf-8", "replace")
        raise UserError(
            f"another run writes to {folder} ({holder}); wait until it ends, or choose another --out"
        ) from None
