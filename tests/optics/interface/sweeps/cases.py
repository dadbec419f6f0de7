"""A problem to vary, and stand-ins for its design that take milliseconds."""

import io
import os
import signal
import sqlite3
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from types import SimpleNamespace

from PIL import Image

from optics.base.runtime import UserError
from optics.interface.sweeps.variant_work import Designed
from optics.scene.problem import load_problem
from tests.cases import EXAMPLES

DISTANCES = {"target.distance": [200.0, 300.0, 400.0]}


# what makes a picture of the region of the example
PICTURE = {"target.kind": "image", "target.shape": "rectangle", "target.lit": [0.75, 0.75]}


def problem(**changes):
    return load_problem(EXAMPLES / "tophat_circle.toml", changes)


def kept_lens(path, identity):
    """Return the text of lens.json of a problem in a store, "" where it was not kept."""
    with closing(sqlite3.connect(path)) as store:
        row = store.execute("SELECT lens FROM variants WHERE problem = ?", (identity,)).fetchone()
    return row[0] if row else ""


def png(level=128):
    buffer = io.BytesIO()
    Image.new("L", (12, 8), level).save(buffer, "png")
    return buffer.getvalue()


def quick(shared, work):
    """Return numbers that follow from the changes."""
    made = shared.problem.with_(**work.changes)
    distance = made.target.distance
    metrics = {"rel_l2": 1 / distance, "dof": made.lens.rear.freeform.max_level, "estimator": "cells"}
    metrics["rounded"] = 1 + 1e-13 * distance
    metrics |= {"rel_l2_debiased": 1 / distance, "grade": "made" if distance < 250 else "light misses"}
    metrics["verdict"] = "fine" if distance < 250 else "poor"
    return Designed(metrics, png(), '{"lens": 1}' if work.keep_lens else "")


def slow(shared, work):
    time.sleep(0.01)
    return quick(shared, work)


def without_memory(shared, work):
    """Fail at 300 mm for a reason that the next run may not have."""
    if work.changes["target.distance"] == 300:
        raise MemoryError
    return quick(shared, work)


def moving(shared, work):
    """Move the folder "out" of the sweep."""
    with suppress(FileNotFoundError):
        os.rename("out", "moved")
    return quick(shared, work)


def reading(shared, work):
    """Return what is in the picture of the target."""
    picture = shared.files[shared.problem.with_(**work.changes).target.image]
    return Designed({"level": Image.open(io.BytesIO(picture)).getpixel((0, 0))}, b"", "")


def picky(shared, work):
    """Fail at 300 mm, and end the worker at 400 mm."""
    distance = work.changes["target.distance"]
    if distance == 300:
        raise UserError("300 mm is too far; come nearer")
    if distance == 400:
        os.kill(os.getpid(), signal.SIGKILL)
    return quick(shared, work)


class Thread:
    """A pool of one thread of this process, which starts at once."""

    ended = ()

    def __init__(self, executor):
        self._workers = {"thread": SimpleNamespace(executor=executor, threads=1, memory=0)}

    def present(self):
        return self._workers


@contextmanager
def thread_pool(workers, scheduler, tasks):
    with ThreadPoolExecutor(1) as executor:
        yield Thread(executor)
