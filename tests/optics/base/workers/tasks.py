"""Tasks that workers of the tests do."""

import os
import signal
import time
from pathlib import Path

from optics.base.runtime import UserError, load_backend


def add(common, item):
    return common + item


def wait(common, item):
    time.sleep(common)
    return item


def fail_odd(common, item):
    if item % 2:
        raise UserError(f"{item} is odd")
    if item == 4:
        raise ZeroDivisionError("by four")
    return item


class Unreadable:
    """What pickle writes and cannot read back."""

    def __reduce__(self):
        return int, ("none",)


def answer_or_end(common, item):
    """Return what cannot be sent, or cannot be read, or end the process, as items say."""
    if item == "exit":
        raise SystemExit("the task is tired")
    return {"unsent": lambda: 0, "unread": Unreadable()}.get(item, item)


def kill_marked(marked, item):
    """Kill the own process for items that are marked, and note every try in a file."""
    number, folder = item
    with (Path(folder) / str(number)).open("a") as file:
        file.write("x")
    if number in marked:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def kill_once(common, item):
    """Kill the own process where an item comes for the first time."""
    number, folder = item
    tried = Path(folder) / str(number)
    if number % 5 == 0 and not tried.exists():
        tried.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def process_after(seconds, item):
    time.sleep(seconds)
    return os.getpid()


def allocate(common, size):
    return len(bytearray(size))


def fail_in_drjit(common, error):
    """Raise an error inside an operation of Dr.Jit."""
    dr = load_backend("double", 1).dr

    class Fails(dr.CustomOp):
        def eval(self):
            raise error

    dr.custom(Fails)
