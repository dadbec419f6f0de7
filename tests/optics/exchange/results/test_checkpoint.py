"""Checkpoints: every bit comes back, and only to the problem that they belong to."""

import json
from dataclasses import replace

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.exchange.results.checkpoint import checkpoint_owner, read_checkpoint, write_checkpoint
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import picture, small_system, write_problem
from tests.optics.exchange.results.cases import GLOW, some_state, write_glow

FREE_FRONT = {"lens.front.freeform.spans": [4, 4], "lens.front.freeform.max_level": 2}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "checkpoint.json"


def stored(path, problem_file, *changes, state=None):
    """Store a checkpoint of the small problem with changes, and return the problem."""
    problem = load_problem(problem_file(*changes))
    write_checkpoint(path, problem, problem, state or some_state())
    return problem


@pytest.mark.parametrize("stage", [0, 1])
@pytest.mark.parametrize("sags", [1, 2])
def test_a_checkpoint_gives_back_every_bit(path, problem_file, stage, sags):
    state = some_state(stage, sags)
    problem = load_problem(problem_file(FREE_FRONT if sags == 2 else None))
    write_checkpoint(path, problem, problem, state, ["a note"])
    found, notes = read_checkpoint(path, System(problem))
    assert (found.started_from_transport, found.stage, found.history, notes) == (
        True,
        stage,
        state.history,
        ["a note"],
    )
    assert [sag.coefficients.tobytes() for sag in found.sags] == [
        sag.coefficients.tobytes() for sag in state.sags
    ]
    for sag, own in zip(found.sags, state.sags, strict=True):
        np.testing.assert_array_equal(sag.space.cells, own.space.cells)


def test_threads_and_the_pictures_place_may_change_between_runs(path, problem_file, tmp_path):
    stored(path, problem_file)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    moved = load_problem(write_problem(elsewhere, {"run.threads": 2}))
    assert read_checkpoint(path, System(moved))[0].stage == 1


def test_a_checkpoint_belongs_to_the_problem_as_asked_for_and_as_resolved(path, problem_file):
    asked = load_problem(problem_file({"lens.rear.freeform.max_level": "auto"}))
    rear = asked.lens.rear
    resolved = replace(
        asked, lens=replace(asked.lens, rear=replace(rear, freeform=replace(rear.freeform, max_level=2)))
    )
    write_checkpoint(path, asked, resolved, some_state())
    assert read_checkpoint(path, System(resolved))[0].stage == 1
    assert len(set(checkpoint_owner(path).problems)) == 2


@pytest.mark.parametrize(
    "changes",
    [{"run.seed": 1}, {"optimizer.iterations": [7]}, {"target.fit": "pad"}, {"run.precision": "single"}],
    ids=str,
)
def test_anything_else_makes_another_problem(path, problem_file, changes):
    stored(path, problem_file)
    with pytest.raises(UserError, match="belongs to another problem"):
        read_checkpoint(path, System(load_problem(problem_file(changes))))


def test_another_picture_of_the_same_name_makes_another_problem(path, problem_file):
    stored(path, problem_file)
    with pytest.raises(UserError, match="belongs to another problem"):
        read_checkpoint(path, System(load_problem(problem_file(None, picture()[:, ::-1].copy()))))


def test_another_picture_of_the_source_makes_another_problem(path, problem_file, tmp_path):
    write_glow(tmp_path)
    stored(path, problem_file, GLOW)
    write_glow(tmp_path, 100)
    with pytest.raises(UserError, match="belongs to another problem"):
        read_checkpoint(path, System(load_problem(problem_file(GLOW))))


def test_the_place_of_the_sources_picture_may_change_between_runs(path, problem_file, tmp_path):
    write_glow(tmp_path)
    stored(path, problem_file, GLOW)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    write_glow(elsewhere)
    moved = small_system(elsewhere, GLOW)
    assert read_checkpoint(path, moved)[0].stage == 1


@pytest.mark.parametrize(
    ("changes", "sags"), [(None, 0), (None, 2), (FREE_FRONT, 1), (FREE_FRONT, 3)], ids=str
)
def test_a_checkpoint_with_too_few_or_too_many_sags_is_refused(path, problem_file, changes, sags):
    problem = stored(path, problem_file, changes, state=some_state(sags=sags))
    with pytest.raises(UserError, match="cannot resume"):
        read_checkpoint(path, System(problem))


@pytest.mark.parametrize("coefficients", ["AAAA", "####", "", "\u00e9", 3, [1.0], None], ids=repr)
def test_coefficients_that_are_no_bytes_of_numbers_are_damage(path, problem_file, coefficients):
    problem = stored(path, problem_file)
    data = json.loads(path.read_text())
    data["sags"][0]["coefficients"] = coefficients
    path.write_text(json.dumps(data))
    with pytest.raises(UserError, match=r"cannot resume: .* is damaged"):
        read_checkpoint(path, System(problem))


@pytest.mark.parametrize("text", [None, "", "{}", "[]", '{"schema": "thbcad-checkpoint", "version": 3}'])
def test_what_is_no_checkpoint_has_no_owner(path, text):
    if text is not None:
        path.write_text(text)
    assert checkpoint_owner(path) is None
