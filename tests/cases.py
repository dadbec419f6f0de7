"""Folders of the checkout that tests read, folders that workers share, and cases that are seldom run."""

import fcntl
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
DATA = ROOT / "tests" / "data"


THOROUGH = os.environ.get("HYPOTHESIS_PROFILE") == "thorough"  # in `make slow`, see tests/conftest.py


def examples(most, **options):
    """Return the settings of a property of so many examples; a quarter of them, or 8, in `make test`."""
    return settings(max_examples=most if THOROUGH else max(min(most, 8), most // 4), **options)


def slow_unless(often, cases):
    """Return parameters of which those that `often` does not hold for are marked slow."""
    return [pytest.param(case, marks=() if often(case) else pytest.mark.slow) for case in cases]


def shared_folder(tmp_path_factory, name, make):
    """Return a folder that `make(folder)` fills once in a test run, whichever worker comes first."""
    root = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent  # of the workers' own folders
    folder, done = root / name, root / f"{name}.done"
    with (root / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            folder.mkdir()
            make(folder)
            done.touch()
    return folder


def module_at(path):
    """Return the module of a Python file that is part of no package."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def python(program, *arguments, **options):
    """Run a Python program beside this checkout, and return how it ended, with its texts."""
    words = [sys.executable, "-c", program, *map(str, arguments)]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, **options)
