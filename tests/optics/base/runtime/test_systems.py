"""What operating systems do in their own ways, without POSIX as well: locks, helper processes, limits."""

import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack

import pytest

from optics.base.runtime import UserError, require_file_name
from tests.without_posix import without_posix


@pytest.fixture
def environment(tmp_path):
    (tmp_path / "hook").mkdir()
    return without_posix(tmp_path / "hook")


def started(stack, program, environment, *arguments):
    """Start a program, and return it once it has printed a line, with the line."""
    process = subprocess.Popen(
        [sys.executable, "-c", program, *map(str, arguments)],
        env=environment,
        stdout=-1,
        stderr=-1,
        text=True,
    )
    stack.callback(process.communicate)
    stack.callback(process.kill)
    return process, process.stdout.readline()


HOLD = """
import sys, time
from pathlib import Path
from optics.base.runtime.systems import POSIX
from optics.base.runtime import file_lock
with file_lock(Path(sys.argv[1]), "x"):
    print(POSIX, flush=True)
    time.sleep(1000)
"""
TAKE = """
import sys
from pathlib import Path
from optics.base.runtime import Held, file_lock, require_free
path = Path(sys.argv[1])
for take in (require_free, lambda path: file_lock(path, "y").__enter__()):
    try:
        take(path)
        print("free")
    except Held:
        print("held")
"""


def test_without_posix_a_lock_is_held_by_one_until_it_ends_however(tmp_path, environment):
    """Nobody makes the file by asking."""

    def taken():
        done = subprocess.run(
            [sys.executable, "-c", TAKE, lock], env=environment, capture_output=True, text=True
        )
        return done.stdout.split()

    lock = tmp_path / "lock"
    with ExitStack() as stack:
        holder, said = started(stack, HOLD, environment, lock)
        assert said == "False\n"
        assert taken() == ["held", "held"]
        holder.kill()
        holder.wait()
        assert taken() == ["free", "free"]


HELP = """
import sys, time
from pathlib import Path
from optics.base.runtime import address_limit, limit_memory, machine_memory, peak_mb, process_for
limit_memory(1)
assert address_limit() is None
assert machine_memory() > 1e6 * peak_mb() > 1e7
folder = Path(sys.argv[1])
try:
    with process_for("test") as process:
        process.ask("tests.optics.base.runtime.test_systems", "tidied", folder)
        while not (folder / "half").exists():
            time.sleep(0.01)
        raise KeyboardInterrupt
except KeyboardInterrupt:
    pass
assert not (folder / "half").exists()
assert process._process.returncode == 0
with process_for("test") as process:
    print(process.ask("os", "getpid").result(), flush=True)
    process.ask("time", "sleep", 1000)
    time.sleep(1000)
"""


def tidied(folder):
    """Work until interrupted, in short steps, and take the half of a file away."""
    half = folder / "half"
    half.touch()
    try:
        while True:
            time.sleep(0.01)
    finally:
        half.unlink()


def test_without_posix_a_helper_process_tidies_up_and_ends_with_the_first(tmp_path, environment):
    with ExitStack() as stack:
        first, said = started(stack, HELP, environment, tmp_path)
        first.kill()
        assert first.communicate()[1] == ""
        pid = int(said)
        for _ in range(6000):
            try:
                os.kill(pid, 0)
            except ProcessLookupError:
                return
            time.sleep(0.01)
        os.kill(pid, signal.SIGKILL)
        pytest.fail("the helper process goes on")


NAMES = [
    "CON",
    "nul",
    "Com1",
    "LPT9.front",
    "aux .x",
    "L1.",
    "L1 ",
    "a:b",
    'a"b',
    "a/b",
    "a\\b",
    "a\tb",
    "what?",
]


@pytest.mark.parametrize("name", NAMES)
def test_names_that_windows_refuses_are_refused_everywhere(name):
    with pytest.raises(UserError, match=r"would name files that Windows does not take: .*; take another"):
        require_file_name("element[0].name =", name, "take another")


@pytest.mark.parametrize("name", ["L1", "console", "com", "com10", "Linse è 3", ".x", "a.b", "null"])
def test_other_names_are_taken(name):
    require_file_name("element[0].name =", name, "take another")
