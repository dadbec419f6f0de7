"""The device, on which one thread works at a time, and the BLAS threads that would disturb it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache
from threading import RLock
from typing import Any

_LOCK = RLock()


@contextmanager
def device() -> Iterator[None]:
    """Hold the device, since Dr.Jit is one for the whole process, with BLAS on one thread."""
    with _LOCK, one_blas_thread():
        yield


def one_blas_thread() -> AbstractContextManager[None]:
    """Keep BLAS to one thread.

    What it does beside the device are short operations on vectors, whose threads wait for each other, and
    for the next operation on the cores that the device needs: a design took nearly twice as long.
    """
    blas = _blas()
    limit: AbstractContextManager[None] = blas.limit(limits=1, user_api="blas") if blas else nullcontext()
    return limit


@cache
def _blas() -> Any:
    """Return what knows the BLAS of numpy and of scipy; None without the extra, where there is no device."""
    try:
        from threadpoolctl import ThreadpoolController  # once these have loaded theirs
    except ImportError:
        return None
    return ThreadpoolController()
