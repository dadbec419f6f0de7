"""A helper process: what it returns, how it fails, and that it never outlives the first."""

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from optics.base.runtime import NumericalError, UserError, answered, process_for
from tests.cases import ROOT
from tests.without_posix import without_posix

ORPHAN = """
from optics.base.runtime import process_for
import time
from contextlib import suppress
with process_for("test") as process:
    print(process.ask("os", "getpid").result(), flush=True)
    process.ask("time", "sleep", SECONDS)
    time.sleep(1000)
"""


def first_process(program):
    """Start a program that has a helper process, and return (the program, the number of its helper)."""
    first = subprocess.Popen([sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    return first, int(first.stdout.readline())


def gone(pid):
    """Wait until a process has ended; return False where it takes a minute."""
    for _ in range(6000):
        try:
            with open(f"/proc/{pid}/stat") as file:
                if file.read().rpartition(")")[2].split()[0] == "Z":
                    return True
        except OSError:
            return True
        time.sleep(0.01)
    return False


@pytest.fixture
def process():
    with process_for("test") as process:
        yield process


def test_it_is_another_process_that_answers_in_the_order_of_the_questions(process):
    answers = [process.ask("os", "getpid"), *(process.ask("math", "factorial", n) for n in range(5))]
    pid, *rest = (answer.result() for answer in answers)
    assert pid != os.getpid()
    assert rest == [1, 1, 2, 6, 24]
    assert process.ask("optics.base.runtime", "peak_mb").result() > 10


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="no /proc")
def test_it_keeps_no_memory_of_what_it_has_answered(process):
    """80 MB, in a list that holds itself."""
    pid = process.ask("os", "getpid").result()
    process.ask("numpy", "ones", 1).result()

    def held():
        process.ask("os", "getpid").result()  # the one before is tidied up by then
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    before = held()
    process.ask("builtins", "exec", "import numpy; row = [numpy.ones(10**7)]; row.append(row)").result()
    assert held() < before + 20


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no /proc")
def test_its_peak_memory_is_not_that_of_the_process_that_started_it():
    program = "from optics.base.runtime import peak_mb; print(peak_mb())"
    held = b"x" * 200_000_000
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=True, capture_output=True)
    assert len(held) / 1e6 > 2 * float(done.stdout) > 10


def test_what_has_not_begun_is_done_here(process):
    first, second = process.ask("time", "sleep", 0.5), process.ask("os", "getpid")
    assert answered(second, os.getpid) == os.getpid()
    assert first.result() is None
    assert answered(first, pytest.fail) is None


def test_what_it_is_asked_travels_whole_however_long(process):
    """Longer than a pipe holds, in both directions."""
    text = bytes(range(256)) * 10_000
    assert process.ask("zlib", "decompress", process.ask("zlib", "compress", text).result()).result() == text


def test_its_exceptions_are_raised_here_with_where_they_come_from(process, tmp_path):
    with pytest.raises(FileNotFoundError) as caught:
        process.ask("os", "stat", tmp_path / "none").result()
    assert caught.value.filename == str(tmp_path / "none")
    assert "in _called" in caught.value.__notes__[0]
    with pytest.raises(UserError, match="No such file"):
        process.ask("optics.scene.problem", "load_problem", tmp_path / "none.toml").result()
    with pytest.raises(ModuleNotFoundError):
        process.ask("no_module_of_this_name", "run").result()
    assert process.ask("math", "factorial", 3).result() == 6


def test_an_exception_of_another_package_is_told_as_text(process):
    with pytest.raises(RuntimeError, match=r"LinAlgError: .*square"):
        process.ask("numpy.linalg", "inv", [[1.0, 2.0]]).result()


class Unreadable:
    """An argument that can be sent and not read."""

    def __reduce__(self):
        return int, ("none",)


def fail_with_a_lock():
    raise UserError.__new__(UserError, threading.Lock())


def test_what_cannot_be_read_or_sent_there_is_an_error_and_not_its_end(process):
    pid = process.ask("os", "getpid").result()
    with pytest.raises(ValueError, match="invalid literal"):
        process.ask("builtins", "repr", Unreadable()).result()
    with pytest.raises(TypeError, match="cannot pickle"):
        process.ask("threading", "Lock").result()
    with pytest.raises(RuntimeError, match="UserError"):
        process.ask("tests.optics.base.runtime.test_helper_process", "fail_with_a_lock").result()
    assert process.ask("os", "getpid").result() == pid


def test_a_lack_of_memory_is_one_here(process):
    with pytest.raises(MemoryError, match="allocate"):
        process.ask("numpy", "ones", 1 << 55).result()


def test_it_is_kept_and_made_anew_after_a_failure(process):
    pid = process.ask("os", "getpid").result()
    with process_for("test") as same:
        assert same is process

    def interrupted():
        with process_for("test") as same:
            same.ask("time", "sleep", 1000)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert gone(pid)
    with process_for("test") as other:
        assert other.ask("os", "getpid").result() != pid


def test_the_same_work_within_itself_fails_with_its_own_error():
    used = []

    def fail():
        with process_for("twice") as outer, process_for("twice") as inner:
            used.extend([outer, inner])
            raise ValueError("mine")

    with pytest.raises(ValueError, match="mine"):
        fail()
    assert used[0] is used[1]
    with process_for("twice") as other:
        assert other is not used[0]


def test_work_that_is_stopped_cleans_up_and_says_nothing(tmp_path, capfd):
    """As when Ctrl-C comes while a file is written; also before the process has begun to listen."""

    def interrupted(wait):
        with process_for("test") as process:
            process.ask("tests.optics.base.runtime.test_helper_process", "written", tmp_path / "whole")
            while wait and not (tmp_path / "half").exists():
                time.sleep(0.01)
            raise KeyboardInterrupt

    for wait in (False, True):
        with pytest.raises(KeyboardInterrupt):
            interrupted(wait)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_work_that_python_cannot_stop_at_once_is_stopped_and_says_nothing(tmp_path, capfd):
    """In `__del__`, where nothing can be raised."""

    def interrupted():
        with process_for("test") as process:
            process.ask("tests.optics.base.runtime.test_helper_process", "deleted", tmp_path / "deleting")
            while not (tmp_path / "deleting").exists():
                time.sleep(0.01)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert capfd.readouterr() == ("", "")


class StoppedWhileLoaded:
    """An argument whose package is stopped while it is loaded."""

    def __reduce__(self):
        return stopped_package, ()


def stopped_package():
    """Say by an error of its own that it was stopped, as C code does that forgets the cause."""
    with suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    raise ImportError("a package")


@pytest.mark.parametrize("arguments", [[], [StoppedWhileLoaded()]], ids=["called", "asked"])
def test_a_process_that_is_stopped_while_it_loads_says_nothing(arguments, capfd):
    def stopped():
        with process_for("test") as process:
            process.ask(
                "tests.optics.base.runtime.test_helper_process", "stopped_package", *arguments
            ).result()

    with pytest.raises(RuntimeError, match=r"ended with code 0 in .*stopped_package"):
        stopped()
    assert capfd.readouterr() == ("", "")


def deleted(path):
    """Delete an object, which takes until the signal has come, and wait longer than anybody."""

    class Last:
        def __del__(self):
            path.touch()
            time.sleep(1000)

    Last()
    time.sleep(1000)


def written(path):
    """Write a file as slowly as nobody waits for."""
    half = path.with_name("half")
    try:
        half.touch()
        time.sleep(1000)
        half.rename(path)
    finally:
        half.unlink(missing_ok=True)


def test_a_request_holds_what_its_arguments_are_when_it_is_asked(process):
    """It is sent when those before it are answered."""
    numbers = [1, 2]
    process.ask("time", "sleep", 0.1)
    asked = process.ask("builtins", "sum", numbers)
    numbers.append(4)
    assert asked.result() == 3


@pytest.mark.parametrize("kind", [RuntimeError, NumericalError])
def test_a_process_that_dies_is_a_failure_with_a_remedy_not_a_wait(process, kind):
    with (
        pytest.raises(kind, match=r"ended with code -9 in os\.kill.* free memory"),
        process_for("test") as process,
    ):
        process.ask("os", "kill", process.ask("os", "getpid").result(), signal.SIGKILL).result()


def hold_the_lock(begun):
    """Hold Python's lock for longer than anybody waits, as OCCT does for seconds."""
    Path(begun).touch()
    ctypes.PyDLL(None).usleep(200_000_000)


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel tells it of a pipe on Linux only")
def test_it_ends_when_the_first_process_is_killed_also_where_python_cannot_listen(tmp_path):
    begun = tmp_path / "begun"
    request = f'ask("tests.optics.base.runtime.test_helper_process", "hold_the_lock", {str(begun)!r})'
    first, pid = first_process(ORPHAN.replace('ask("time", "sleep", SECONDS)', request))
    while not begun.exists():
        time.sleep(0.01)
    first.kill()
    first.communicate()
    assert gone(pid)


@pytest.mark.parametrize("seconds", [0, 2], ids=["idle", "at work"])
def test_it_ends_when_the_first_process_is_killed(seconds):
    first, pid = first_process(ORPHAN.replace("SECONDS", str(seconds)))
    first.kill()
    first.communicate()
    assert gone(pid)


FORKED = """
import os, sys
import decimal
from optics.base.runtime import process_for
secret = open(os.devnull)
with process_for("other", True), process_for("test", True) as process:
    loaded = "sorted(m for m in __import__('sys').modules if m == 'decimal')"
    print(process.ask("builtins", "eval", loaded).result())
    print(len(process.ask("os", "listdir", "/proc/self/fd").result()))
    pid, group = (process.ask("os", name, *of).result() for name, of in (("getpid", ()), ("getpgid", (0,))))
    print(pid == group != os.getpgid(0), process.ask("os", "getppid").result() == os.getpid())
    print(process.ask("builtins", "print", "no output of the first").result(), flush=True)
    print(pid, flush=True)
    process.ask("time", "sleep", 1000)
    sys.stdin.read()
    raise SystemExit(7)
"""


@pytest.fixture
def first():
    """A process with a helper that is a copy of it, where processes can be copied."""
    if sys.platform != "linux":
        pytest.skip("only Linux tells a process that it has one thread")
    with subprocess.Popen(
        [sys.executable, "-c", FORKED], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as first:
        yield first
        first.kill()


def test_a_copy_has_what_is_loaded_here_and_holds_two_pipes_and_no_other_file(first):
    lines = [first.stdout.readline().rstrip() for _ in range(4)]
    # three of its own, two pipes, and that of the list
    assert lines == ["['decimal']", "6", "True True", "None"]


@pytest.mark.parametrize("how", ["killed", "failed"])
def test_a_copy_ends_with_the_first_process(first, how):
    pid = [first.stdout.readline() for _ in range(5)][-1]
    if how == "killed":
        first.kill()
    first.communicate("")
    assert first.returncode == (-signal.SIGKILL if how == "killed" else 7)
    assert gone(int(pid))


HELP = """
import sys, time
from pathlib import Path
from optics.base.runtime import POSIX, address_limit, limit_memory, machine_memory, peak_mb, process_for
assert not POSIX
limit_memory(1)
assert address_limit() is None
assert machine_memory() > 1e6 * peak_mb() > 1e7
folder = Path(sys.argv[1])
try:
    with process_for("test") as process:
        process.ask("tests.optics.base.runtime.test_helper_process", "tidied", folder)
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


def test_without_posix_a_helper_process_tidies_up_and_ends_with_the_first(tmp_path):
    (tmp_path / "hook").mkdir()
    first = subprocess.Popen(
        [sys.executable, "-c", HELP, tmp_path],
        env=without_posix(tmp_path / "hook"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    pid = int(first.stdout.readline())
    first.kill()
    assert first.communicate()[1] == ""
    assert gone(pid)


DONE = """
import os
from optics.base.runtime import process_for

def asked(forked):
    with process_for("test", forked) as process:
        answers = [process.ask("os", "getpid"), process.ask("math", "factorial", 5)]
        process.done()
        return process, [answer.result() for answer in answers]

process, (pid, factorial) = asked(True)
assert factorial == 120  # what was asked before is answered
assert process._process.wait(60) is not None
kept, (other, _) = asked(True)  # there are threads now: it is not forked
assert other != pid
assert asked(True)[1] == [other, 120]
assert kept._process.poll() is None
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks")
def test_a_forked_process_that_is_done_ends_once_it_has_answered():
    subprocess.run([sys.executable, "-c", DONE], cwd=ROOT, check=True)
