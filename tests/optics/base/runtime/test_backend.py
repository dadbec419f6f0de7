"""Dr.Jit while it is loaded, operations of our own in it, and its threads."""

import subprocess
import sys

import pytest

INTERRUPTED = """
import enum, signal
from optics.base.runtime import load_backend

def made(kind, *arguments, made=enum.EnumMeta.__call__, **options):
    if len(arguments) > 1:  # a class, not a member
        signal.raise_signal(signal.SIGINT)
    return made(kind, *arguments, **options)

handlers = signal.default_int_handler, lambda number, frame: None
for number, handler in zip((signal.SIGINT, signal.SIGTERM), handlers):
    signal.signal(number, handler)
enum.EnumMeta.__call__ = made
try:
    load_backend()
except KeyboardInterrupt:
    print("interrupted", load_backend().dr.thread_count() > 0)
assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers
"""


def test_an_interrupt_while_dr_jit_is_loaded_is_one_behind_it():
    """Its C++ code makes classes of Python, and ends the process where that fails."""
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "interrupted True\n"), done.stderr


@pytest.mark.parametrize(
    ("raised", "met"), [(KeyboardInterrupt, KeyboardInterrupt), (ValueError, RuntimeError)]
)
def test_an_interrupt_within_an_operation_is_one_outside(backend, raised, met):
    """Dr.Jit makes a RuntimeError of all that an operation raises, which nobody takes for Ctrl-C."""

    class Operation(backend.dr.CustomOp):
        def eval(self, x):
            raise raised

    with pytest.raises(met):
        backend.custom(Operation, backend.Float(1.0))


@pytest.mark.parametrize(("most", "taken"), [(5, 2), (2, 2), (1, 1), (0, 1), (-3, 1)])
def test_work_on_fewer_threads_has_its_own_again_behind_it(backend, most, taken):
    seen = []

    def interrupted():
        with backend.on_threads(most):
            seen.append(backend.dr.thread_count())
            raise KeyboardInterrupt

    backend.dr.set_thread_count(2)
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [*seen, backend.dr.thread_count()] == [taken, 2]
    backend.dr.set_thread_count(1)  # as the other tests have it
