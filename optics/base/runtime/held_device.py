"""The device, on which one thread works at a time, and the BLAS threads that would disturb it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
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
    limit: AbstractContextManager[None] = _blas().limit(limits=1, user_api="blas")
    return limit


@cache
def _blas() -> Any:
    from threadpoolctl import ThreadpoolController  # once numpy and scipy have loaded theirs

    return ThreadpoolController()
