"""The same problem gives the same bytes in any language, time zone and folder, and under `python -O`."""

import os
import shutil
import subprocess
import sys

import pytest

from tests.cases import ROOT
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import FIGURES, QUICK, content

# a module of this name is small_system at the start of every Python process that finds it
LANGUAGE = "import locale; locale.setlocale(locale.LC_ALL, '')\n"
SURROUNDINGS = ["language", "time zone", "folder", "optimised"]


def german(folder):
    """Return the environment of a process with decimal commas, or skip where there is no such locale."""
    (folder / "sitecustomize.py").write_text(LANGUAGE)
    environment = {"LC_ALL": "de_DE.UTF-8", "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])}
    if shutil.which("localedef"):
        make = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / "de_DE.UTF-8")]
        if subprocess.run(make, capture_output=True).returncode == 0:
            environment["LOCPATH"] = str(folder)
    asked = "import locale; print(locale.localeconv()['decimal_point'])"
    process = subprocess.run(
        [sys.executable, "-c", asked], env=os.environ | environment, capture_output=True, text=True
    )
    if process.stdout.strip() != ",":
        pytest.skip("no German locale here")
    return environment


def design(folder, environment=None, options=(), cwd=None):
    """Return {file: what it holds, apart from times and memory} of a design of the quick problem."""
    problem = write_problem(folder, QUICK)
    result = folder / "result"
    subprocess.run(
        [sys.executable, *options, "-m", "optics", "design", str(problem), "--out", str(result)],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | (environment or {}),
        cwd=cwd or folder,
        check=True,
        capture_output=True,
    )
    return {path.relative_to(result).as_posix(): content(path) for path in result.rglob("*.*")}


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return design(tmp_path_factory.mktemp("plain"), {"LC_ALL": "C", "TZ": "UTC"})


@pytest.mark.slow
@pytest.mark.parametrize("surroundings", SURROUNDINGS)
def test_the_bytes_of_a_result_depend_on_the_problem_alone(plain, surroundings, tmp_path):
    assert {f"figures/{name}.png" for name in FIGURES} | {"lens.step", "lens.json"} <= set(plain)
    folder = tmp_path / "Größe 1"
    folder.mkdir()
    found = {
        "language": lambda: design(tmp_path, german(tmp_path)),
        "time zone": lambda: design(tmp_path, {"TZ": "Asia/Kathmandu"}),
        "folder": lambda: design(folder, {"PYTHONHASHSEED": "7"}, cwd="/"),
        "optimised": lambda: design(tmp_path, options=["-O"]),
    }[surroundings]()
    assert set(found) == set(plain)
    assert [name for name in plain if found[name] != plain[name]] == []
