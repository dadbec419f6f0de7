"""Commands on a design of two free lenses in a row: what they say of each, and what they refuse."""

import pytest

from optics.exchange.results import beside
from optics.interface.relighting import other_source
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import store_result
from tests.optics.interface.commands.cases import data_of, printed, refused

TWO_LENSES = """
title = "two lenses"
source = { kind = "point", half_angle = 20.0, distance = 30.0 }
target = { kind = "tophat", position = [0, 0, 200], half_width = [80, 60], pixels = [24, 18] }
optimizer.iterations = [2]

[[element]]
kind = "lens"
name = "A"
material = "PMMA"
thickness = 6.0
front.half_width = [14.0, 14.0]
rear.half_width = [16.0, 16.0]
rear.radius = -60.0
rear.conic = -1.0
rear.freeform = { z_freedom = 1.5, max_level = 1 }

[[element]]
kind = "lens"
name = "B"
position = [0, 0, 20]
material = "N-BK7"
thickness = 12.0
front.half_width = [22.0, 22.0]
rear.half_width = [24.0, 24.0]
rear.radius = -80.0
rear.conic = -1.0
rear.freeform = { z_freedom = 2.0, max_level = 1 }
"""


@pytest.fixture
def problem(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(TWO_LENSES)
    return path


@pytest.mark.slow
def test_losses_of_the_last_face_are_its_own(problem, capsys, coarse_concentration):
    """All four faces together reflect 15 %, each 4 % at normal incidence: none bends light far."""
    said = printed(capsys, "check", problem, "--explain")
    assert "which bends it far" not in said
    assert "skips A.front in all evaluations but the first: A.front has no freeform" in said
    expected = data_of(capsys, "check", problem)["expected"]
    # r of PMMA, of N-BK7: 3.92 %, 4.24 %
    assert expected["reflected"] == pytest.approx(0.9608**2 * 0.9576 * 0.0424, rel=0.05)


def test_other_programs_are_refused_before_anything_is_done(problem, tmp_path, capsys):
    asked = load_problem(problem)
    result = store_result(tmp_path / "result", asked, System(asked).base).path
    said = refused(capsys, "verify", result, "--light", "occt")
    assert "this is element.B; verify it without --light" in said
    assert not (result / "verify_light").exists()


def test_files_of_one_element_say_whose_they_are(problem):
    assert beside(load_problem(problem)) == [
        "this is B alone, the last of the free elements; the others are in A.lens.json"
    ]


def test_a_lamp_stands_before_the_first_element_on_the_axis_of_the_own_light(problem):
    """The own light comes along z, and meets the plane z - 3 = y - 2 of the vertex at z = 1."""
    asked = load_problem(problem, {"element.A.position": [1.0, 2.0, 3.0], "element.A.tilt": [45.0, 0.0, 0.0]})
    lamp = other_source("led:2mm@30mm", asked)
    assert lamp.position == pytest.approx((0.0, 0.0, -29.0))
    assert lamp.tilt == (0.0, 0.0, 0.0)
