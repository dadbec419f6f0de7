"""What the command line refuses, in one sentence, and odd input that it takes."""

import os

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.designing.optimisation import State
from optics.interface.api import Design
from optics.interface.commands import main
from tests.optics.cases import picture, write_problem
from tests.optics.interface.commands.cases import QUICK, data_of, raising, refused, strict_json

COARSE = {"lens.rear.freeform.max_level": 0, "verify.rel_l2": 2.0}

# ---- bad input ----


@pytest.mark.usefixtures("no_helpers")
def test_a_lens_without_light_is_refused(tmp_path, capsys):
    problem = write_problem(tmp_path, {"lens.rear.radius": 0.3, "target.distance": 400.0})
    assert "change the lens prescription" in refused(capsys, "design", problem, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("out", ["file", "file/below"])
def test_a_result_path_that_is_a_file_is_refused(tmp_path, capsys, out):
    (tmp_path / "file").write_text("keep me")
    message = refused(capsys, "design", write_problem(tmp_path), "--out", tmp_path / out)
    assert "choose another with --out" in message
    assert (tmp_path / "file").read_text() == "keep me"


@pytest.mark.usefixtures("no_helpers")
def test_an_old_result_stays_whole_until_the_new_one_is_there(copy, tmp_path, monkeypatch):
    """Interrupted, a folder still holds the problem and the lens of the run before, which belong together."""
    out = copy
    before = (out / "problem.toml").read_text(), (out / "lens.json").read_text()
    monkeypatch.setattr("optics.interface.api.design_run.shape_lens", raising(KeyboardInterrupt))
    problem = write_problem(tmp_path, QUICK | {"lens.index": 1.6})
    assert main(["design", str(problem), "--out", str(out), "--force"]) == 130
    assert ((out / "problem.toml").read_text(), (out / "lens.json").read_text()) == before


@pytest.mark.slow
def test_a_step_file_that_cannot_be_written_is_one_sentence(tmp_path, capsys, monkeypatch):
    """A helper process writes it: what fails there ends as if it had failed here."""

    def designed(system, *arguments):
        (tmp_path / "out" / "lens.step").mkdir()
        return system.base, State(False, 0, system.base.sags)

    monkeypatch.setattr("optics.interface.api.design_run.shape_lens", designed)
    problem = write_problem(tmp_path, QUICK | COARSE | {"target.pixels": [16, 16]})
    assert main(["design", str(problem), "--out", str(tmp_path / "out")]) == 2
    *progress, message = capsys.readouterr().err.splitlines()
    assert all("% done" in line for line in progress)
    assert message.startswith("thbcad: cannot write or read")
    assert "directory" in message


def test_a_result_file_that_is_a_folder_is_refused(tmp_path, capsys):
    (tmp_path / "out" / "problem.toml").mkdir(parents=True)
    message = refused(capsys, "design", write_problem(tmp_path, QUICK), "--out", tmp_path / "out")
    assert "problem.toml: it is a folder" in message


@pytest.mark.parametrize("date", ["abc", "", "1e3", "-1", "1" * 13])
@pytest.mark.parametrize("command", [["new"], ["check", "problem.toml"]])
def test_a_date_that_packages_cannot_read_is_refused(capsys, monkeypatch, date, command):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", date)
    assert "SOURCE_DATE_EPOCH must be whole seconds since 1970" in refused(capsys, *command)
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    assert main(["new"]) == 0


PIPES = ("problem.toml", "lens.json", "result.json", "metrics.json", "history.csv", "irradiance.npz")


@pytest.mark.parametrize("name", PIPES)
def test_a_pipe_in_the_place_of_a_file_of_a_result_is_refused(copy, name):
    """Reading it would wait for ever."""
    (copy / name).unlink()
    os.mkfifo(copy / name)
    with pytest.raises((UserError, OSError), match=r"it is a pipe or a device, not a file"):
        Design.load(copy)


def test_a_pipe_in_the_place_of_a_lens_is_refused(result, tmp_path, capsys):
    os.mkfifo(tmp_path / "pipe.json")
    message = refused(capsys, "verify", result / "lens.step", "--lens", tmp_path / "pipe.json")
    assert "pipe.json: it is a pipe or a device, not a file" in message


# ---- odd but good input ----


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{"target.pixels": [2, 2]}, {"target.pixels": [3, 3]}, {}], ids=str)
def test_a_picture_of_3_by_3_pixels_works(tmp_path, capsys, changes):
    image = np.array([[0, 90, 255], [10, 200, 30], [255, 0, 60]], dtype=np.uint8)
    problem = write_problem(tmp_path, QUICK | COARSE | changes, image)
    data_of(capsys, "design", problem, "--out", tmp_path / "out")


@pytest.mark.slow
def test_a_new_run_replaces_an_old_result(copy, tmp_path, capsys):
    before = strict_json((copy / "metrics.json").read_text())
    problem = write_problem(tmp_path, QUICK | {"lens.rear.freeform.max_level": 0}, picture()[::-1].copy())
    data = data_of(capsys, "design", problem, "--out", copy, "--force")
    assert data["metrics"]["rel_l2"] != before["rel_l2"]
    assert main(["verify", str(copy), "--no-optiland"]) == 0
