"""What travels between the processes of a run as bytes, so that what cannot has a sentence in every pool.

As of helper processes it is multiprocessing's own format: messages of this program, never a file.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.reduction import ForkingPickler
from typing import Any

from optics.base.runtime import UserError
from optics.base.workers.lack_of_memory import lacks_memory

COMMON, ITEM, VALUE = "what all tasks share", "the item of a task", "what a task returns"


def packed(thing: Any, what: str) -> bytes:
    """Return a thing as bytes.  Raises UserError : it cannot be sent; names what it is."""
    with _told(what):
        return bytes(ForkingPickler.dumps(thing))


def unpacked(message: bytes, what: str) -> Any:
    """Return the thing that was packed.  Raises UserError : it cannot be read; names what it is."""
    with _told(what):
        return ForkingPickler.loads(message)


@contextmanager
def _told(what: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        if lacks_memory(error):
            raise
        raise UserError(
            f"{what} cannot be sent to another process ({type(error).__name__}: {error}); it must be what "
            "pickle writes and reads back, without open files or lambdas"
        ) from error
