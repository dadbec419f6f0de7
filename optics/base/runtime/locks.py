"""Locks that one process holds at a time: the system lets go when it ends, however that ends."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from optics.base.runtime.systems import POSIX, flocked

MOST_BYTES = 1000  # of what a lock says
LONGER = 1.0  # seconds, than anybody takes to ask


class Held(Exception):
    """Another process holds a lock; what it says of itself."""


@contextmanager
def file_lock(path: Path, words: str) -> Iterator[None]:
    """Hold the lock that a file is; it says who holds it, and goes away with the block.

    Raises Held : another process holds it.
    """
    if not POSIX:
        with _sole(path):
            yield
        return
    handle = _locked(path)
    try:
        os.ftruncate(handle, 0)
        os.write(handle, words.encode()[:MOST_BYTES])
        yield
    finally:
        try:
            path.unlink(missing_ok=True)
        finally:
            os.close(handle)


def require_free(path: Path) -> None:
    """Raise Held while a process holds the lock; nothing is written, and others may ask at the same time.

    Without `flock` to ask is to hold the lock for a moment: who may not write the file learns nothing.
    """
    if not POSIX:
        if path.exists() and os.access(path, os.W_OK):
            with _sole(path):
                return
        return
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:  # nobody ever locked it
        return
    try:
        _require_locked(handle, shared=True)
    finally:
        os.close(handle)


@contextmanager
def _sole(path: Path) -> Iterator[None]:
    """Hold the lock where no system call shares one; it may be asked for just now, which takes a moment."""
    from filelock import FileLock, Timeout  # POSIX does without

    lock = FileLock(path)
    try:
        lock.acquire(timeout=LONGER)
    except Timeout:
        raise Held("another process") from None
    try:
        yield
    finally:
        lock.release()


def _locked(path: Path) -> int:
    """Return the handle of the lock file, locked."""
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _require_locked(handle)
            if path.exists() and os.path.samestat(path.stat(), os.fstat(handle)):
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)  # the process before removed the file between the two calls


def _require_locked(handle: int, shared: bool = False) -> None:
    if not flocked(handle, shared):
        raise Held(os.read(handle, MOST_BYTES).decode("utf-8", "replace"))
