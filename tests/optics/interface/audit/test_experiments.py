"""Commands of an audit: each runs once, in a process of this package, with kernels of its own."""

import os
import subprocess
from pathlib import Path

import pytest

import thbcad
from optics.base.runtime import usable_cores
from optics.interface.audit.experiments import (
    KERNELS,
    Ended,
    Experiments,
    Unexpected,
    experiments_in,
)
from optics.scene.problem import load_problem
from tests.cases import EXAMPLES


@pytest.fixture
def experiments(tmp_path):
    (tmp_path / "work").mkdir()
    return Experiments(tmp_path / "work", tmp_path / "kernels")


def test_the_square_is_that_of_the_examples(experiments):
    assert load_problem(experiments.folder / "square.toml") == load_problem(EXAMPLES / "tophat_square.toml")


def test_a_command_runs_once_and_as_this_package(experiments, monkeypatch):
    monkeypatch.delenv("PYTHONPATH", raising=False)
    ended = experiments.command("--version")
    assert (ended.code, ended.out, ended.err) == (0, f"thbcad {thbcad.__version__}\n", "")
    assert experiments.command("--version") is ended


def test_the_time_of_a_command_is_measured_in_calibration_loops(experiments, monkeypatch):
    monkeypatch.setattr("optics.interface.audit.experiments.PASSES", 1)
    ended = experiments._run(("--version",), timed=True)
    assert min(ended.cpu, ended.wall, ended.loop) > 0
    assert ended.ratio == ended.cpu / ended.loop


def test_a_command_that_fails_is_told_with_its_last_sentence(experiments):
    ended = experiments.command("design", "square.toml", "--set", "target.distnace=3")
    with pytest.raises(Unexpected, match=r"^thbcad design .* ended with exit code 2: .*unknown key"):
        ended.data(0)


def test_data_of_a_command_are_its_json():
    assert Ended(("check",), 1, '{"a": 1}', "").data(0, 1) == {"a": 1}


def test_a_command_ends_where_the_audit_is_stopped(experiments, monkeypatch):
    done = []

    class Stopped:
        def __init__(self, *_, **settings):
            assert settings["env"][KERNELS] == str(experiments.kernels)

        def communicate(self):
            if done:
                return "", ""
            raise KeyboardInterrupt

        def terminate(self):
            done.append("terminated")

    monkeypatch.setattr(subprocess, "Popen", Stopped)
    with pytest.raises(KeyboardInterrupt):
        experiments.command("design")
    assert done == ["terminated"]


@pytest.mark.parametrize("before", [None, "/elsewhere"])
def test_kernels_and_cores_are_those_of_before_again(before, tmp_path, monkeypatch):
    monkeypatch.delenv(KERNELS, raising=False)
    if before:
        monkeypatch.setenv(KERNELS, before)
    monkeypatch.chdir(tmp_path)
    cores = usable_cores()
    with experiments_in(Path()) as made:
        assert os.environ[KERNELS] == str(made.kernels) == str(tmp_path / "kernels")
        assert usable_cores() == min(cores, 2)
    assert os.environ.get(KERNELS) == before
    assert usable_cores() == cores
