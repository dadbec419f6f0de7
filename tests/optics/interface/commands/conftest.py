"""A whole run that several files of tests look at."""

import json
import shutil
from concurrent.futures import Future
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.cases import shared_folder
from tests.optics.cases import store_result, write_problem
from tests.optics.interface.commands.cases import QUICK, command


@pytest.fixture(autouse=True)
def _quick_check(coarse_concentration):
    """No test here asks how exact the greatest concentration is: tests/optics/light/outgoing does."""


def design_as_a_process(folder):
    """Design the quick problem on two threads; keep exit code and output beside the result."""
    problem = write_problem(folder, QUICK | {"run.threads": 2})
    process = command("design", problem, "--out", folder / "result", "--json", cwd=folder)
    stdout, stderr = process.communicate()
    ended = {"code": process.returncode, "stdout": stdout, "stderr": stderr}
    (folder / "ended.json").write_text(json.dumps(ended))


@pytest.fixture(scope="session")
def golden(tmp_path_factory):
    """A whole run as a process, on two threads: its folder, exit code, output, and the problem file."""
    folder = shared_folder(tmp_path_factory, "golden", design_as_a_process)
    ended = json.loads((folder / "ended.json").read_text())
    return SimpleNamespace(path=folder / "result", problem=folder / "problem.toml", **ended)


@pytest.fixture
def no_helpers(monkeypatch):
    """Helper processes that answer nothing: for runs that end before they are needed."""
    idle = SimpleNamespace(ask=lambda *_: Future())
    monkeypatch.setattr("optics.interface.api.helpers", lambda forked: nullcontext((idle, idle)))


@pytest.fixture
def copy(golden, tmp_path):
    """A copy of the golden result that a test may spoil."""
    return shutil.copytree(golden.path, tmp_path / "copy")


@pytest.fixture
def stored(tmp_path):
    """A function that stores the result of a changed problem, its lens unshaped, and returns its folder."""

    def made(changes=None, drop=()):
        problem = load_problem(write_problem(tmp_path, changes, drop=drop))
        return store_result(tmp_path / "result", problem, System(problem).base).path

    return made


@pytest.fixture
def result(stored):
    """A result folder of an unshaped lens."""
    return stored()
