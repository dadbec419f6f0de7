"""Whole runs as processes, stopped at sampled times: what lies there is true, and the next run ends well."""

import shutil
import signal
import time

import pytest

from optics.interface.commands import main
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import QUICK, assert_no_false_claim, assert_whole, command

NEW = QUICK | {"title": "new", "target.distance": 70.0, "target.pixels": [24, 24]}
SIGNALS = signal.SIGKILL, signal.SIGTERM, signal.SIGINT
CODES = {signal.SIGKILL: -9, signal.SIGTERM: 143, signal.SIGINT: 130}
TIMES = 9  # from the process's start to its end

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    return write_problem(tmp_path_factory.mktemp("new"), NEW)


@pytest.fixture(scope="module")
def seconds(problem):
    """How long a run takes."""
    start = time.perf_counter()
    assert command("design", problem, "--out", problem.parent / "out").wait() == 0
    return time.perf_counter() - start


@pytest.mark.parametrize("sample", range(TIMES))
def test_a_killed_run_claims_nothing_false_and_goes_on(golden, problem, seconds, tmp_path, capsys, sample):
    folder, number = shutil.copytree(golden.path, tmp_path / "out"), SIGNALS[sample % len(SIGNALS)]
    process = command("design", problem, "--out", folder, "--force")
    time.sleep(seconds * (sample + 0.5) / TIMES)
    process.send_signal(number)
    _, stderr = process.communicate()
    assert process.returncode in (CODES[number], 0)  # 0: it had ended
    assert "Traceback" not in stderr
    assert_no_false_claim(folder)
    resumed = sample % 2 and (folder / "checkpoint.json").exists()
    assert main(["design", str(problem), "--out", str(folder), "--resume" if resumed else "--force"]) == 0
    assert "Traceback" not in capsys.readouterr().err
    assert_whole(folder)
