"""The command as a process: how it ends."""

import gc
import io
import os
import signal
import subprocess
import sys
from pathlib import Path
from runpy import run_module

import pytest

from optics.base.runtime import Phase, Progress, note
from optics.designing.progress import drawing
from optics.interface.commands import main
from optics.interface.commands.outcome import Outcome
from tests.cases import ROOT, python
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import COARSE, raising

FULL = Path("/dev/full")
needs_full = pytest.mark.skipif(not FULL.exists(), reason="no /dev/full")


def ended(*arguments, closed="", **streams):
    """Run the command line with buffers, as most do, and return what it says and how it ends.

    closed : what a shell closes for it.  streams : its stdout or stderr.
    """
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    environment.pop("PYTHONUNBUFFERED", None)
    program = ["-c", COARSE] if "check" in arguments else ["-m", "optics"]
    words = ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, *program, *map(str, arguments)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.run(words, env=environment, text=True, check=False, **(pipes | streams))


def test_a_command_searches_for_garbage_rarely_and_not_at_its_end(monkeypatch):
    before, usual, seen = gc.get_threshold(), (700, 10, 10), []  # of these tests, and of Python
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]

    def ran():
        seen.append(gc.get_threshold())
        return 3

    monkeypatch.setattr("optics.interface.commands.main", ran)
    gc.set_threshold(*usual)
    gc.unfreeze()  # as in a new process
    try:
        with pytest.raises(SystemExit) as ended:
            run_module("optics", run_name="__main__")
        assert ended.value.code == 3
        assert seen[0][0] > 10 * usual[0]
        assert gc.get_freeze_count() > 0
    finally:
        gc.set_threshold(*before)
        gc.freeze()
        for number, handler in zip((signal.SIGINT, signal.SIGTERM), handlers):
            signal.signal(number, handler)


@pytest.mark.parametrize("debug", [False, True])
def test_an_error_of_the_program_itself_is_one_sentence_and_has_a_code_of_its_own(
    tmp_path, capsys, monkeypatch, debug
):
    """1 would say that a check failed.  The traceback is shown to those who ask for it."""
    error = ZeroDivisionError("nothing\x1b to divide by")
    monkeypatch.setattr("optics.interface.commands.check_command.system_of", raising(error))
    monkeypatch.delenv("THBCAD_DEBUG", raising=False)
    if debug:
        monkeypatch.setenv("THBCAD_DEBUG", "1")
    assert main(["check", str(write_problem(tmp_path))]) == 70
    captured = capsys.readouterr()
    assert captured.out == ""
    *above, line = captured.err.splitlines()
    assert line.startswith(
        "thbcad: internal error: ZeroDivisionError: nothing\\x1b to divide by; please report"
    )
    assert any("Traceback" in row for row in above) == debug
    assert bool(above) == debug


@pytest.mark.parametrize("limited", [True, False])
def test_a_thread_that_cannot_start_is_a_lack_of_memory_or_of_processes(
    tmp_path, capsys, monkeypatch, limited
):
    """Its stack takes memory: under a limit of the address space (ulimit -v) that is what is missing."""
    limit = 300_000 << 10 if limited else None
    for module in ("optics.base.workers.lack_of_memory", "optics.interface.commands.cli"):
        monkeypatch.setattr(f"{module}.address_limit", lambda: limit)
    error = RuntimeError("can't start new thread")
    monkeypatch.setattr("optics.interface.commands.check_command.system_of", raising(error))
    assert main(["check", str(write_problem(tmp_path))]) == 3
    told = capsys.readouterr().err
    if limited:
        assert told.startswith(
            "thbcad: out of memory; raise its limit (ulimit -v 300000), or use fewer pixels"
        )
    else:
        assert told.startswith("thbcad: the system starts no more threads; raise the limit of processes")


INTERRUPTED = """
import os, signal, sys
sys.argv = [{name!r}, "check", "x.toml"]
class Interrupting:
    def find_spec(name, path, target=None):
        if name == "thbcad.doors":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupting)
import optics
"""


@pytest.mark.parametrize("name", ["/usr/bin/thbcad", "script.py"])
def test_ctrl_c_among_the_first_imports_is_one_line_of_the_command(name):
    """A script has its own handlers of signals: importing the library leaves them alone."""
    found = python(INTERRUPTED.format(name=name))
    if name == "script.py":
        assert found.returncode != 130 or "KeyboardInterrupt" in found.stderr
        assert "thbcad: interrupted" not in found.stderr
    else:
        assert (found.returncode, found.stderr) == (130, "thbcad: interrupted\n")


def test_control_characters_of_a_title_do_not_reach_the_terminal(tmp_path, capsys):
    """They could recolour or overwrite lines, or type commands."""
    title = "a\x1b[31m\0\x9b2Jb\nc\u202ed"
    assert main(["check", str(write_problem(tmp_path, {"title": title}))]) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines()[0].startswith("a\\x1b[31m\\x00\\x9b2Jb\\x0ac\\x202ed  ")
    assert all(c.isprintable() or c == "\n" for c in captured.out + captured.err)


def test_a_line_of_a_result_is_one_line_whatever_its_folder_is_called(capsys, monkeypatch):
    lines = ["solid out\ndir/lens.step", "light as asked for"]
    monkeypatch.setattr("optics.interface.commands.check_command.check", lambda options: Outcome({}, lines))
    assert main(["check", "any.toml"]) == 0
    assert capsys.readouterr().out == "solid out\\x0adir/lens.step\nlight as asked for\n"


# ---- streams that cannot be written ----


def working(options):
    """Do a command's work: with progress, and with a note."""
    bar = drawing(sys.stderr)
    progress = Progress([Phase("one", 1.0), Phase("two", 1.0)], bar)
    progress.begin("two")
    progress.finish()
    note("a note")
    bar.close()
    return Outcome({}, ["the result"])


@needs_full
@pytest.mark.parametrize("terminal", [False, True], ids=["lines", "bar"])
def test_work_goes_on_where_its_progress_cannot_be_written(capsys, monkeypatch, terminal):
    monkeypatch.setattr("optics.interface.commands.check_command.check", working)
    with FULL.open("w") as full:
        monkeypatch.setattr(full, "isatty", lambda: terminal, raising=False)
        monkeypatch.setattr(sys, "stderr", full)
        assert main(["check", "a"]) == 0
        assert sys.stderr is full
    assert capsys.readouterr().out == "the result\n"


def test_a_stream_of_messages_is_otherwise_what_it_was(monkeypatch):
    class Terminal(io.StringIO):
        encoding = "latin-1"

        def isatty(self):
            return True

    seen = []

    def looking(options):
        seen.extend([sys.stderr.isatty(), sys.stderr.encoding, sys.stderr.write("abc")])
        return Outcome({}, [])

    monkeypatch.setattr("optics.interface.commands.check_command.check", looking)
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert main(["check", "a"]) == 0
    assert seen == [True, "latin-1", 3]
    assert sys.stderr.getvalue() == "abc"


@pytest.mark.slow
@needs_full
def test_an_error_that_cannot_be_told_keeps_its_exit_code(tmp_path):
    with FULL.open("w") as full:
        done = ended("check", tmp_path / "none.toml", stderr=full)
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.slow
def test_messages_that_nobody_reads_take_no_result_away(tmp_path):
    reader, writer = os.pipe()
    os.close(reader)
    done = ended("check", write_problem(tmp_path), "-v", stderr=writer)
    os.close(writer)
    assert done.returncode == 0
    assert "problem is valid" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("file", ["problem.toml", "none.toml"])
def test_with_stderr_closed_nothing_of_it_goes_to_stdout(tmp_path, file):
    write_problem(tmp_path)
    done = ended("check", tmp_path / file, "-v", closed="2>&-")
    assert done.returncode == (0 if file == "problem.toml" else 2)
    assert "thbcad: " not in done.stdout
    assert ("problem is valid" in done.stdout) == (file == "problem.toml")


@needs_full
@pytest.mark.parametrize("words", [[], ["--help"], ["design", "--help"], ["--version"], ["new"]], ids=str)
def test_what_cannot_be_printed_is_one_sentence(words):
    with FULL.open("w") as full:
        done = ended(*words, stdout=full)
    assert (done.returncode, done.stderr) == (
        2,
        "thbcad: cannot print to stdout: No space left on device; what was written stays\n",
    )


@pytest.mark.parametrize("words", [["--help"], ["new"]], ids=str)
def test_a_reader_that_has_gone_is_no_error(words):
    reader, writer = os.pipe()
    os.close(reader)
    done = ended(*words, stdout=writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


STOPPED = """
import os, signal, sys
class Stop:
    def find_spec(self, name, path=None, target=None):
        if name == MODULE:
            os.kill(os.getpid(), NUMBER)
sys.meta_path.insert(0, Stop())
signal.signal(signal.SIGINT, signal.default_int_handler)  # the tests may run in the background
sys.argv[1:] = ["check", "none.toml"]
from optics.__main__ import entry
entry()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "module", ["gc", "argparse", "optics.interface.commands.cli", "optics.interface.commands.check_command"]
)
def test_a_signal_ends_the_command_with_one_line_and_its_code_also_among_its_imports(module, number):
    program = STOPPED.replace("MODULE", repr(module)).replace("NUMBER", str(int(number)))
    done = python(program)
    word = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}[number]
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "", f"thbcad: {word}\n")


@pytest.mark.parametrize("moment", ["sys.exit", "again"])
def test_a_signal_ends_the_command_with_one_line_also_while_it_ends(moment):
    """And a second one, while the first is answered."""
    program = f"""
import atexit, os, signal, sys
from optics.interface import commands
signal.signal(signal.SIGINT, signal.default_int_handler)
stop = lambda *_: os.kill(os.getpid(), signal.SIGINT)
if {moment!r} == "again":
    commands.main = lambda: (_ for _ in ()).throw(KeyboardInterrupt)
else:
    commands.main = lambda: atexit.register(stop) and 0
from optics.__main__ import entry
entry()
"""
    done = python(program)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "thbcad: interrupted\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_behind_all_that_a_command_does_leaves_its_code(number):
    """Python takes its handlers back in its last steps: what is registered first is called there."""
    program = f"""
import atexit, os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
atexit.register(os.kill, os.getpid(), {int(number)})
sys.argv[1:] = ["--version"]
from optics.__main__ import entry
entry()
"""
    done = python(program)
    assert (done.returncode, done.stderr) == (0, "")
