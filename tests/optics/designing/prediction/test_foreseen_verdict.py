"""Limits that a design will miss are said before it, and no prediction is made where nothing tells it."""

import re

import numpy as np
import pytest

import optics
from optics.designing.prediction import blur_limits, expectation_lines, expected, foreseen_misses
from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.cases import EXAMPLES
from tests.optics.cases import example_system, small_system

pytestmark = pytest.mark.usefixtures("coarse_concentration")

BRIGHT = {"target.half_width": [60.0, 60.0], "target.distance": 400.0}  # asks for more sag than z_freedom
SUN = {"source.divergence_profile": "sun", "lens.rear.freeform.z_freedom": 3.0}

STROKES = np.zeros((48, 48), np.uint8)
STROKES[8:40:6] = 255


def bright_top_hat(**changes):
    return load_problem(EXAMPLES / "tophat_square.toml").with_(**BRIGHT, **changes)


def foreseen(system, backend, limits=None):
    found, _ = expected(system, backend)
    if limits is None and system.blurred:
        limits = blur_limits(system, backend)
    return foreseen_misses(system, found, limits, backend)


@pytest.mark.every(2)
@pytest.mark.parametrize("pixels", [96, 160])
def test_nothing_is_predicted_where_the_bound_of_the_sag_cuts_the_map_off(backend, pixels):
    """With 1.2 % of the coefficients cut off the map had started the design, and 0.01 was promised."""
    system = System(bright_top_hat(**{"target.pixels": (pixels, pixels)}))
    found, _ = expected(system, backend)
    assert found.rel_l2 is None
    assert found.sag > found.freedom
    (line,) = [line for line in expectation_lines(system, found) if line.startswith("rel_l2")]
    assert line.startswith("rel_l2: not predicted, since the design does not start from the whole")


def test_bad_light_on_a_square_is_not_called_good():
    """A bound that cuts the map off leaves dark corners, of which the lens was said to make the light."""
    made = optics.design(bright_top_hat(**{"target.pixels": (48, 48), "run.threads": 1}))
    assert made.measurement.metrics["uniformity"]["min_over_mean"] < 0.4
    assert made.verdict.grade == "light misses"
    assert "uniformity U0" in made.verdict.sentence


@pytest.mark.slow
def test_thin_strokes_in_the_sun_are_said_to_miss(backend, tmp_path):
    """The blur alone keeps rel_l2 above the limit, whatever the lens."""
    system = small_system(tmp_path, SUN | {"verify.rel_l2": "auto", "target.distance": 400.0}, STROKES)
    limits = blur_limits(system, backend)
    assert limits.least > 0.3
    sentences = foreseen(system, backend, limits)
    words = f"this design will miss its limit: the blur allows a rel_l2 of {limits.least:.2g} at least"
    assert any(said.startswith(words) and said.endswith("asks for 0.1") for said in sentences)
    (remedy,) = (said for said in sentences if "at this distance --set target.half_width=" in said)
    x, y = map(float, re.search(r"half_width=\[([\d.]+),([\d.]+)\]", remedy).groups())
    wider = System(system.problem.with_(**{"target.half_width": (x, y)}))
    assert blur_limits(wider, backend).least < 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"target.half_width": [25.0, 25.0], "target.distance": np.inf},  # degrees: eight times are no angle
        {"target.half_width": [20.0, 20.0], "target.distance": 40.0},  # a wider one lies far off the axis
        {
            "target.half_width": [20.0, 20.0],
            "target.distance": 100.0,
            "target.surface": "cylinder",
            "target.radius": -60.0,
        },
    ],
)
def test_no_larger_target_is_proposed_where_the_spot_of_the_base_lens_says_nothing(
    backend, tmp_path, changes
):
    system = small_system(tmp_path, {"source.divergence": 6.0, "verify.rel_l2": "auto"} | changes, STROKES)
    found, _ = expected(system, backend)
    limits = blur_limits(system, backend)
    assert limits.least > 0.1
    assert not any("larger target" in said for said in foreseen_misses(system, found, limits, backend))


@pytest.mark.slow
def test_a_square_as_wide_as_the_blur_cannot_be_decided(backend, tmp_path):
    changes = SUN | {
        "target.kind": "tophat",
        "target.lit": [0.1, 0.1],
        "target.distance": 400.0,
        "verify.lit_efficiency": 0.0,
    }
    (said,) = foreseen(small_system(tmp_path, changes), backend)
    assert said.startswith("the uniformity may stay undecided: of the base lens a margin of ")


@pytest.mark.slow
def test_light_that_does_not_reach_the_target_is_said(backend, tmp_path):
    narrow = {"source.kind": "point", "source.distance": 5.0, "source.half_angle": 80.0}
    found = foreseen(small_system(tmp_path, narrow | {"lens.rear.freeform.z_freedom": 5.0}), backend)
    assert any(said.endswith("verify.lit_efficiency asks for 50% on the lit region") for said in found)


@pytest.mark.slow
def test_a_target_aside_of_the_lens_is_said_with_its_angle(backend, tmp_path):
    """40 mm aside, 40 mm behind the rear vertex at 6 mm."""
    problem = small_system(tmp_path, {"target.half_width": [10.0, 10.0]}).problem
    aside = problem.with_(**{"target.distance": None, "target.position": (0.0, 40.0, 46.0)})
    found = foreseen(System(aside), backend)
    assert any("the target's middle lies 45 degrees off the axis: aim" in said for said in found)


@pytest.mark.slow
def test_a_problem_that_suits_its_limits_gets_no_warning(backend):
    system = example_system("tophat_square")
    assert foreseen(system, backend) == []
