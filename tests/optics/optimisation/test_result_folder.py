"""The result folder: checkpoints and stored problems."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from optics.optimisation.result_folder import ResultFolder
from optics.optimisation.state import Row, State
from optics.problem import load_problem
from optics.runtime import UserError
from optics.system import OpticalSystem
from tests.optics.cases import picture, rough, small_space, write_problem
from thbcad.surfaces import THBSurface


@pytest.fixture
def folder(tmp_path):
    out = ResultFolder(tmp_path / "deep" / "out")
    out.prepare()
    return out


FREE_FRONT = {"lens.front.freeform.spans": [4, 4], "lens.front.freeform.max_level": 2}


def some_state(stage=1, sags=1):
    space = small_space()
    history = Row(0, 49, 1, 0.1, 0.3, 0.25), Row(0, 49, 2, 1 / 3, 1e-17, 1.5, 0.7)
    surfaces = tuple(THBSurface(space, rough(space, seed=seed)) for seed in range(sags))
    return State(True, stage, surfaces, history)


@pytest.mark.parametrize("stage", [0, 1])
@pytest.mark.parametrize("sags", [1, 2])
def test_a_checkpoint_gives_back_every_bit(folder, problem_file, stage, sags):
    problem, state = load_problem(problem_file(FREE_FRONT if sags == 2 else None)), some_state(stage, sags)
    assert not folder.has_checkpoint()
    folder.write_checkpoint(problem, state)
    assert folder.has_checkpoint()
    found = folder.read_checkpoint(OpticalSystem(problem))
    assert (found.moved, found.stage, found.history) == (True, stage, state.history)
    assert [sag.coefficients.tobytes() for sag in found.sags] == [
        sag.coefficients.tobytes() for sag in state.sags
    ]
    for sag, own in zip(found.sags, state.sags, strict=True):
        np.testing.assert_array_equal(sag.space.cells, own.space.cells)
    folder.drop_checkpoint()
    assert not folder.has_checkpoint()
    folder.drop_checkpoint()


def test_threads_and_the_pictures_place_may_change_between_runs(folder, problem_file, tmp_path):
    folder.write_checkpoint(load_problem(problem_file()), some_state())
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    moved = load_problem(write_problem(elsewhere, {"run.threads": 2}))
    assert folder.read_checkpoint(OpticalSystem(moved)).stage == 1


@pytest.mark.parametrize(
    "changes",
    [{"run.seed": 1}, {"optimizer.iterations": [7]}, {"target.fit": "pad"}, {"run.precision": "single"}],
    ids=str,
)
def test_anything_else_makes_another_problem(folder, problem_file, changes):
    folder.write_checkpoint(load_problem(problem_file()), some_state())
    with pytest.raises(UserError, match="belongs to another problem"):
        folder.read_checkpoint(OpticalSystem(load_problem(problem_file(changes))))


def test_another_picture_of_the_same_name_makes_another_problem(folder, problem_file):
    folder.write_checkpoint(load_problem(problem_file()), some_state())
    with pytest.raises(UserError, match="belongs to another problem"):
        folder.read_checkpoint(OpticalSystem(load_problem(problem_file(None, picture()[:, ::-1].copy()))))


@pytest.mark.parametrize(
    ("changes", "sags"), [(None, 0), (None, 2), (FREE_FRONT, 1), (FREE_FRONT, 3)], ids=str
)
def test_a_checkpoint_with_too_few_or_too_many_sags_is_refused(folder, problem_file, changes, sags):
    problem = load_problem(problem_file(changes))
    folder.write_checkpoint(problem, some_state(sags=sags))
    with pytest.raises(UserError, match="cannot resume"):
        folder.read_checkpoint(OpticalSystem(problem))


def test_a_stored_problem_brings_its_picture(folder, problem_file):
    given = problem_file()
    folder.write_problem(load_problem(given))
    (given.parent / "picture.png").unlink()
    given.unlink()
    stored = folder.read_problem()
    assert stored.target.image == str(folder.path / "target.png")
    folder.write_problem(stored)  # onto itself
    assert folder.read_problem() == stored


GLOW = {"source.profile": "image", "source.image": "glow.png"}


def write_glow(folder, level=200):
    Image.fromarray(np.array([[10, 0], [0, level]], dtype=np.uint8)).save(folder / "glow.png")


def test_a_stored_problem_brings_its_sources_picture(folder, problem_file, tmp_path):
    write_glow(tmp_path)
    given = problem_file(GLOW)
    folder.write_problem(load_problem(given))
    light = OpticalSystem(load_problem(given)).source.profile.light
    for name in ("picture.png", "glow.png", "problem.toml"):
        (tmp_path / name).unlink()
    stored = folder.read_problem()
    assert Path(stored.source.image).parent == folder.path
    np.testing.assert_array_equal(OpticalSystem(stored).source.profile.light, light)
    folder.write_problem(stored)  # onto itself
    assert folder.read_problem() == stored


def test_another_picture_of_the_source_makes_another_problem(folder, problem_file, tmp_path):
    write_glow(tmp_path)
    folder.write_checkpoint(load_problem(problem_file(GLOW)), some_state())
    write_glow(tmp_path, 100)
    with pytest.raises(UserError, match="belongs to another problem"):
        folder.read_checkpoint(OpticalSystem(load_problem(problem_file(GLOW))))


def test_the_place_of_the_sources_picture_may_change_between_runs(folder, problem_file, tmp_path):
    write_glow(tmp_path)
    folder.write_checkpoint(load_problem(problem_file(GLOW)), some_state())
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    write_glow(elsewhere)
    assert folder.read_checkpoint(OpticalSystem(load_problem(write_problem(elsewhere, GLOW)))).stage == 1


def test_nothing_is_left_where_a_folder_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(
        UserError,
        match=r"cannot write to the result folder .*file/out: Not a directory; choose another with --out",
    ):
        ResultFolder(tmp_path / "file" / "out").prepare()
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_the_history_is_written_with_every_digit(folder):
    folder.write_history(some_state().history)
    lines = (folder.path / "history.csv").read_text().splitlines()
    assert lines[0] == "level,dof,evaluation,loss,fit,seconds,fresh_fit"
    assert lines[1].endswith(",")
    assert [float(v) for v in lines[2].split(",")] == [0, 49, 2, 1 / 3, 1e-17, 1.5, 0.7]
