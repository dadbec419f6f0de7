"""What runs in a worker: it is made ready once, then does one task after the other."""

from __future__ import annotations

import os
from importlib import import_module
from time import perf_counter
from typing import Any, NamedTuple

from optics.base.runtime import NumericalError, UserError, limit_memory, peak_mb
from optics.base.workers.lack_of_memory import lacks_memory
from optics.base.workers.messages import COMMON, ITEM, VALUE, packed, unpacked
from thbcad import __version__

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
MOST_KEPT = 4  # runs whose common data a worker of a cluster keeps: more clients at a time are rare

_kept: dict[str, Any] = {}


class UnpreparedError(RuntimeError):
    """A worker does not know the run of a task: another process has taken its name."""


class Answer(NamedTuple):
    """What a worker says of a task.

    value : packed.  failure : "" where it succeeded, else a sentence.  seconds : it took.
    peak_mb : the most memory that the worker has held so far.
    """

    value: bytes
    failure: str
    seconds: float
    peak_mb: float


def prepare(run: str, common: bytes, memory: int) -> str:
    """Make this worker ready for a run, and return its version of thbcad.

    Numerical libraries take one thread, if they are not loaded yet.

    common : what all tasks share, packed.  memory : bytes that the process may take, 0 for any.

    Raises UserError : what they share cannot be read.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")
    if memory:
        limit_memory(memory)
    while len(_kept) >= MOST_KEPT:
        _kept.pop(next(iter(_kept)), None)
    _kept[run] = unpacked(common, COMMON)
    return __version__


def answer(run: str, module: str, function: str, item: bytes) -> Answer:
    """Do a task: function(common, item).  What it raises becomes a sentence, also where it wants to exit.

    item : packed.

    Raises UnpreparedError : see there.
    """
    if run not in _kept:
        raise UnpreparedError(run)
    start, value, failure = perf_counter(), b"", ""
    try:
        found = getattr(import_module(module), function)(_kept[run], unpacked(item, ITEM))
        value = packed(found, VALUE)
    except (Exception, SystemExit) as error:
        failure = _sentence(error)
    return Answer(value, failure, perf_counter() - start, peak_mb())


def _sentence(error: BaseException) -> str:
    if isinstance(error, UserError | NumericalError):
        return str(error)
    if lacks_memory(error):
        return "out of memory; use fewer pixels, rays or levels, or fewer workers"
    return str(UserError(f"internal error: {type(error).__name__}: {error}"))
