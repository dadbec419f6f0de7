"""The problem file of a lens whose front alone is free: lens.rear.freeform = false."""

import pytest

from optics.base.runtime import UserError
from optics.scene.problem import Freeform, commented_problem, load_problem
from tests.optics.cases import FREE_REAR, FRONT, front_problem, write_problem
from tests.optics.scene.problem.cases import load_text


def test_false_is_a_rear_that_is_its_conic_alone(tmp_path):
    problem = front_problem(tmp_path)
    assert problem.lens.rear.freeform is None
    assert list(problem.lens.free) == ["front"]


def test_a_front_may_be_fixed_by_the_same_word(tmp_path):
    problem = load_problem(write_problem(tmp_path, {"lens.front.freeform": False}))
    assert problem == load_problem(write_problem(tmp_path))
    assert list(problem.lens.free) == ["rear"]


def test_the_written_problem_is_read_back_as_it_was(tmp_path):
    problem = front_problem(tmp_path)
    assert "freeform = false" in problem.to_toml()
    assert load_text(tmp_path, problem.to_toml()) == problem


def test_keys_make_the_table_of_a_fixed_rear_and_take_it_away(tmp_path):
    problem = front_problem(tmp_path)
    free = problem.with_(**{"lens.rear.freeform.degree": 4})
    assert free.lens.rear.freeform == Freeform(degree=4)
    assert free.with_(**{"lens.rear.freeform": False}) == problem
    assert (
        load_problem(tmp_path / "problem.toml", {"lens.rear.freeform": {}}).lens.rear.freeform == Freeform()
    )


def test_the_file_of_a_free_rear_is_written_as_before(tmp_path):
    problem = load_problem(write_problem(tmp_path))
    assert "freeform = " not in problem.to_toml()
    assert "freeform = " not in commented_problem().replace("# ", "")


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"lens.rear.freeform": True}, "lens.rear.freeform must be a table, got True"),
        ({"lens.rear.freeform": 0}, "lens.rear.freeform must be a table, got 0"),
        ({"lens.rear.freeform": "no"}, "lens.rear.freeform must be a table, got 'no'"),
        ({"lens.rear.radius": "auto"}, "lens.rear.radius and lens.rear.conic must be numbers"),
        ({"lens.rear.conic": "auto"}, "lens.rear.radius and lens.rear.conic must be numbers"),
    ],
)
def test_what_does_not_go_together_gets_one_sentence(tmp_path, changes, sentence):
    with pytest.raises(UserError, match=sentence):
        load_problem(write_problem(tmp_path, FRONT | changes, drop=FREE_REAR))
