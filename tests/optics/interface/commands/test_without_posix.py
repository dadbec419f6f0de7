"""A design where the packages find what Windows has: no fcntl, no resource, few signals."""

import json
import subprocess
import sys

import pytest

from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import QUICK
from tests.without_posix import without_posix


@pytest.mark.slow  # a whole program
def test_a_design_needs_no_posix_and_has_the_same_bytes(tmp_path, golden):
    (tmp_path / "hook").mkdir()
    problem, out = write_problem(tmp_path, QUICK | {"run.threads": 2}), tmp_path / "out"
    done = subprocess.run(
        [sys.executable, "-m", "optics", "design", problem, "--out", out, "--quiet"],
        env=without_posix(tmp_path / "hook"),
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (golden.code, "")
    (out / ".lock").unlink()  # filelock takes it away on Windows only
    assert {p.name for p in out.iterdir()} == {p.name for p in golden.path.iterdir()}
    assert json.loads((out / "result.json").read_text("utf-8"))["ok"]
    for name in ("lens.step", "lens.json", "problem.toml", "verify.json"):
        assert (out / name).read_bytes() == (golden.path / name).read_bytes()
