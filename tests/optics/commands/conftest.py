"""A whole run that several files of tests look at."""

from __future__ import annotations

import shutil
from types import SimpleNamespace

import pytest

from tests.optics.cases import write_problem
from tests.optics.commands.cases import QUICK, command


@pytest.fixture(scope="module")
def golden(tmp_path_factory):
    """A whole run as a process, on two threads: its folder, exit code, output, and the problem file."""
    folder = tmp_path_factory.mktemp("golden")
    problem = write_problem(folder, QUICK | {"run.threads": 2})
    process = command("design", problem, "--out", folder / "result", "--json", cwd=folder)
    stdout, stderr = process.communicate()
    return SimpleNamespace(
        path=folder / "result", problem=problem, code=process.returncode, stdout=stdout, stderr=stderr
    )


@pytest.fixture
def copy(golden, tmp_path):
    """A copy of the golden result that a test may spoil."""
    return shutil.copytree(golden.path, tmp_path / "copy")
