"""What the session lacks is said before any work: letters in its locale, names that are text, memory."""

import os
import resource
import subprocess
import sys

import pytest

from tests.cases import ROOT
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import COARSE, refused

ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def ended(*arguments, room=None, program=("-m", "optics"), **variables):
    """Run the command line in a session of its own, and return how it ends.

    room : most bytes of addresses.  program : of Python.  variables : of its environment.
    """
    limits = None if room is None else lambda: resource.setrlimit(resource.RLIMIT_AS, (room, room))
    return subprocess.run(
        [sys.executable, *program, *map(os.fsencode, arguments)],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | variables,
        capture_output=True,
        check=False,
        preexec_fn=limits,
    )


@pytest.mark.parametrize("words", [("--set", "title=Gr\udcc3\udcb6\udcdfe"), ("--out", "out\udcff")])
def test_an_argument_that_is_no_text_is_refused_before_any_work(tmp_path, capsys, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    line = refused(capsys, "design", write_problem(tmp_path), *words)
    assert "is no text in this locale (utf-8); set LC_ALL=C.UTF-8, or rename what it names" in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["picture.png", "problem.toml"]


def test_letters_in_an_ascii_locale_are_refused_before_any_work(tmp_path):
    found = ended("design", write_problem(tmp_path), "--set", "title=é", "--out", tmp_path / "out", **ASCII)
    assert found.returncode == 2
    assert b"is no text in this locale (ascii); set LC_ALL=C.UTF-8" in found.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_title_that_an_ascii_locale_cannot_print_is_written_by_codes(tmp_path):
    """The problem file is UTF-8, whatever the locale."""
    path = write_problem(tmp_path, {"title": "Größe"})
    found = ended("check", path, program=("-c", COARSE), **ASCII)
    assert found.returncode == 0
    assert b"Gr\\xf6\\xdfe" in found.stdout


@pytest.mark.slow
def test_a_backend_for_windows_that_is_not_there_does_not_matter():
    """matplotlib would refuse to be loaded, after all work."""
    program = "from optics.interface.commands import main; main(['check', 'none.toml']); import matplotlib"
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "nonsense"}
    found = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, check=False)
    assert found.returncode == 0
    assert b"none.toml" in found.stderr


@pytest.mark.slow
@pytest.mark.parametrize("room", [100, 300, 500, 700])
def test_a_lack_of_memory_is_called_so(tmp_path, room):
    """Dr.Jit would say that there is no LLVM library, or end the process."""
    found = ended("check", write_problem(tmp_path), room=room << 20)
    assert found.returncode == 3
    told = f"thbcad: out of memory; raise its limit (ulimit -v {room << 10}), or use fewer pixels"
    assert found.stderr.decode().startswith(told)
