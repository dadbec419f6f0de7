"""`thbcad sweep`: what is printed of a sweep, and what is refused before anything runs."""

from functools import partial

import pytest

from optics.interface.commands import main
from optics.interface.sweeps import sweep
from tests.cases import EXAMPLES
from tests.optics.interface.commands.cases import data_of, printed, refused
from tests.optics.interface.sweeps.cases import moving, picky, quick, thread_pool

PROBLEM = str(EXAMPLES / "tophat_circle.toml")
VARY = ["--vary", "target.distance=200:300:2"]


@pytest.fixture
def by(monkeypatch):
    """Return a function that sets what stands in for the design, on a thread and without plots."""
    monkeypatch.setattr("optics.interface.sweeps.running.worker_pool", thread_pool)
    monkeypatch.setattr("optics.interface.sweeps.sweep_folder.metric_plots", lambda sweep: {})
    return partial(monkeypatch.setattr, "optics.interface.sweeps.running.designed")


def test_a_sweep_says_how_many_variants_are_done_and_which_is_best(by, tmp_path, capsys):
    by(quick)
    lines = printed(capsys, "sweep", PROBLEM, *VARY, "--out", tmp_path, "--quiet").splitlines()
    assert lines[:2] == ["2 variants: 2 done; 1 made, 1 light misses", "best: target.distance = 200: fine"]
    assert lines[2] == f"table {tmp_path / 'sweep.csv'}   page {tmp_path / 'sweep.html'}"


@pytest.mark.parametrize("done", [False, True])
def test_a_stopped_sweep_says_that_it_goes_on_where_something_is_stored(
    by, monkeypatch, tmp_path, capsys, done
):
    by(quick)

    def stopped(*plan, **options):
        if done:
            sweep(*plan, **options)
        raise KeyboardInterrupt

    monkeypatch.setattr("optics.interface.commands.sweep_command.run", stopped)
    assert main(["sweep", PROBLEM, *VARY, "--out", str(tmp_path)]) == 130
    assert ("the same command with --resume goes on" in capsys.readouterr().err) is done


def test_failing_variants_are_told_and_the_rows_are_data(by, tmp_path, capsys):
    by(picky)
    data = data_of(capsys, "sweep", PROBLEM, *VARY, "--out", tmp_path, "--quiet")
    assert data["counts"] == {"done": 1, "failed": 1, "killed": 0, "invalid": 0}
    assert data["rows"][1]["sentence"] == "300 mm is too far; come nearer"
    only = ["--vary", "target.distance=300", "--out", str(tmp_path)]
    said = printed(capsys, "sweep", PROBLEM, *only, "--quiet", code=1)
    assert "failed: 300 mm is too far; come nearer" in said


def test_a_folder_that_is_moved_while_the_sweep_runs_is_told_with_the_remedy(
    by, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    by(moving)
    said = refused(capsys, "sweep", PROBLEM, *VARY, "--out", "out", "--quiet")
    assert said.startswith("thbcad: out/sweep.sqlite was removed or moved while the sweep ran; bring it back")
    (tmp_path / "moved").rename("out")
    assert "2 variants: 2 done" in printed(
        capsys, "sweep", PROBLEM, *VARY, "--out", "out", "--quiet", "--resume"
    )


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--vary", "target.distence=[1]"], "--vary: unknown key target.distence"),
        (["--vary", "target.distance=-200:400:3"], "target.distance must be at least 1e-06, got -200"),
        ([*VARY, "--vary", "target.distance=5"], "--vary: target.distance is varied twice"),
        ([*VARY, "--workers", "0"], "the number of workers must be a whole number from 1 to 1024, got 0"),
        ([*VARY, "--workers", "2", "--scheduler", "tcp://x:1"], "give a number of workers or a scheduler"),
        ([*VARY, "--resume"], "nothing to resume"),
        ([], "the following arguments are required: --vary"),
    ],
)
def test_what_cannot_be_swept_is_refused_in_one_sentence(words, sentence, tmp_path, capsys):
    assert sentence in refused(capsys, "sweep", PROBLEM, *words, "--out", tmp_path / "out", "--quiet")
    assert not (tmp_path / "out").exists()
