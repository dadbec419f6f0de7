"""One run at a time in a result folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from optics.base.runtime import Held, UserError, file_lock, require_free

LOCK = ".lock"


@contextmanager
def run_lock(folder: Path, title: str) -> Iterator[None]:
    """Hold the lock of a folder; the file says which run holds it, and goes away with the run.

    Raises UserError : another run holds it.
    """
    with _telling(folder), file_lock(folder / LOCK, f"process {os.getpid()}, {title!r}"):
        yield


def require_no_run(folder: Path) -> None:
    """Raise UserError while a run writes to the folder."""
    with _telling(folder):
        require_free(folder / LOCK)


@contextmanager
def _telling(folder: Path) -> Iterator[None]:
    try:
        yield
    except Held as error:
        raise UserError(
            f"another run writes to {folder} ({error}); wait until it ends, or choose another --out"
        ) from None
