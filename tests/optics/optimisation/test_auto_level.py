"""Levels that a problem leaves to the program come from the detail of the transport map."""

import numpy as np
import pytest
from PIL import Image

from optics.optimisation import resolved
from optics.problem import AUTO, FINEST_AUTO, load_problem, problem_to_toml
from optics.runtime import UserError
from tests.optics.cases import write_problem
from tests.optics.optimisation.cases import loaded

AUTOMATIC = {"lens.rear.freeform.max_level": AUTO, "lens.rear.freeform.z_freedom": 20.0}


def level_of(folder, backend, picture):
    Image.fromarray(picture).save(folder / "picture.png")
    system, start = resolved(loaded(folder, AUTOMATIC, image=picture), backend)
    assert start is not None
    return system.problem.lens.rear.freeform.max_level


def test_finer_detail_takes_more_levels(tmp_path, backend):
    """A smooth slope of light needs the least level, a board of few pixels' squares the finest."""
    across = np.linspace(60, 200, 96)
    smooth = np.round(np.tile(across, (96, 1))).astype(np.uint8)
    board = (200 * ((np.indices((96, 96)) // 6).sum(axis=0) % 2) + 20).astype(np.uint8)
    least, most = (level_of(tmp_path, backend, picture) for picture in (smooth, board))
    assert least == 3
    assert least < most <= FINEST_AUTO


def test_numbers_are_left_as_they_are(tmp_path, backend):
    system = loaded(tmp_path)
    assert resolved(system, backend) == (system, None)


def test_the_choice_is_written_into_the_result_as_a_number(tmp_path, backend):
    system, _ = resolved(loaded(tmp_path, AUTOMATIC), backend)
    (tmp_path / "again.toml").write_text(problem_to_toml(system.problem), "utf-8")
    level = load_problem(tmp_path / "again.toml").lens.rear.freeform.max_level
    assert type(level) is int
    assert level == system.problem.lens.rear.freeform.max_level


def test_auto_survives_the_trip_through_toml(tmp_path):
    system = loaded(tmp_path, AUTOMATIC)
    assert system.problem.lens.rear.freeform.finest == FINEST_AUTO
    (tmp_path / "again.toml").write_text(problem_to_toml(system.problem), "utf-8")
    assert load_problem(tmp_path / "again.toml") == system.problem


@pytest.mark.parametrize("value", ["fine", "Auto", True, 2.5, -1, 13])
def test_other_levels_are_refused_with_the_key(tmp_path, value):
    with pytest.raises(UserError, match=r"lens\.rear\.freeform\.max_level must be"):
        load_problem(write_problem(tmp_path, {"lens.rear.freeform.max_level": value}))


@pytest.mark.parametrize("value", ["yes", 1, 0.0])
def test_true_and_false_are_no_other_values(tmp_path, value):
    with pytest.raises(UserError, match=r"optimizer\.fresnel must be true or false"):
        load_problem(write_problem(tmp_path, {"optimizer.fresnel": value}))
