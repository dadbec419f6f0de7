"""A lens whose front alone is free, from the problem to the verified file."""

import numpy as np
import pytest

import optics
from tests.optics.cases import front_problem


@pytest.mark.slow
def test_a_front_alone_is_designed_stored_and_verified(tmp_path):
    plane = {"lens.rear.radius": float("inf"), "lens.rear.conic": 0.0}
    made = optics.design(front_problem(tmp_path, plane))
    assert made.lens.rear.is_plane
    assert made.metrics["rel_l2_sequential"] < 0.1
    assert made.metrics["rel_l2"] < 0.15  # with the light that the bent front sends into the edges
    assert sum(made.metrics["fates_w"].values()) == pytest.approx(1.0, abs=1e-12)
    folder = made.save(tmp_path / "result")
    assert "freeform = false" in (folder / "problem.toml").read_text("utf-8")
    again = optics.Design.load(folder)
    assert again.problem.lens == made.problem.lens
    assert again.lens.rear.sag is None
    np.testing.assert_array_equal(again.lens.front.sag.coefficients, made.lens.front.sag.coefficients)
    assert made.verify()["ok"]


def test_what_is_left_to_the_program_is_found_for_a_front_alone(tmp_path):
    """The bound of its sag and its finest level; the map asks for no more than the bound."""
    auto = {"lens.front.freeform.z_freedom": "auto", "lens.front.freeform.max_level": "auto"}
    problem = optics.System(front_problem(tmp_path, auto)).problem
    front = problem.lens.front.freeform
    assert 0.5 < front.z_freedom < 3.0
    assert 3 <= front.max_level <= 6
    assert problem.lens.rear.freeform is None
