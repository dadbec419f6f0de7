"""Light that misses an element lands where it goes, unless a stop or an opaque holder takes it."""

import numpy as np
import pytest

from optics.light.analysis.judgement import delivery_checks, loss_notes
from optics.light.analysis.metrics import measure
from optics.scene.problem import Problem
from optics.scene.system import System
from tests.optics.cases import flat_problem

BEAM = {"kind": "collimated", "half_width": (12.0, 12.0), "distance": 40.0}
PLATE = 0.96**2  # of the light passes a plane plate of n = 1.5 along its normal
FULL = 1 / 24**2  # W/mm^2, of the beam
MIDDLES = np.abs(np.arange(24) - 11.5)  # of pixels of 1 mm
RADII = np.maximum(MIDDLES[:, None], MIDDLES)
GRID = {"half_width": (12, 12), "pixels": (24, 24), "lit": (1, 1)}


def light_of(problem):
    system = System(problem)
    return measure(system, system.backend)


def plate(name, half, z):
    face = {"half_width": (half, half)}
    rear = face | {"freeform": False}
    return {
        "kind": "lens",
        "name": name,
        "position": (0, 0, z),
        "index": 1.5,
        "thickness": 3.0,
        "front": face,
        "rear": face if name == "L2" else rear,
    }


def assert_light(found, expected, noise=0.05):
    """noise : of pixels that hold 21 or 22 rays in each direction."""
    assert found.irradiance == pytest.approx(expected, rel=noise, abs=1e-9 * FULL)
    assert found.metrics["efficiency"] == pytest.approx(expected.sum(), rel=1e-3)


def test_a_beam_wider_than_its_lens_puts_a_brighter_frame_around_the_light_of_the_lens():
    found = light_of(flat_problem(BEAM, GRID))
    expected = np.where(RADII < 10, PLATE, 1.0) * FULL
    assert_light(found, expected)
    frame = 1 - (10 / 12) ** 2
    past = found.metrics["past_elements"]
    assert past["past_on_target"] == pytest.approx(frame, rel=1e-3)
    assert past["share_of_target"] == pytest.approx(frame / expected.sum(), rel=1e-3)
    e = expected / expected.mean()
    assert found.metrics["rel_l2_debiased"] == pytest.approx(np.sqrt(np.mean((e - 1) ** 2)), rel=0.02)


def test_light_past_the_lens_and_past_the_target_is_stray():
    metrics = light_of(flat_problem(BEAM, {"half_width": (10, 10), "pixels": (20, 20)})).metrics
    assert metrics["efficiency"] == pytest.approx(PLATE * (10 / 12) ** 2, rel=1e-9)
    assert metrics["stray"] == pytest.approx(1 - (10 / 12) ** 2, rel=0.01)
    assert "past_elements" not in metrics


@pytest.mark.parametrize(
    "holder",
    [
        {"lens": {"clear_aperture": (10, 10)}},
        {"stop": [{"shape": "rectangle", "half_width": (10, 10), "position": (0, 0, -1)}]},
    ],
)
def test_a_stop_or_an_opaque_holder_takes_the_light_past_the_lens(holder):
    found = light_of(flat_problem(BEAM, GRID, **holder))
    assert_light(found, np.where(RADII < 10, PLATE, 0.0) * FULL, noise=1e-6)
    assert "past_elements" not in found.metrics


def test_light_past_the_first_of_two_lenses_goes_on_through_the_second_and_past_both():
    elements = [plate("L1", 6.0, 0.0), plate("L2", 10.0, 20.0)]
    target = {"kind": "tophat", "position": (0, 0, 60)} | GRID
    found = light_of(Problem(source=BEAM, element=elements, target=target))
    expected = np.where(RADII < 6, PLATE**2, np.where(RADII < 10, PLATE, 1.0)) * FULL
    assert_light(found, expected)
    assert found.metrics["past_elements"]["missed"] == ["L1", "L2"]


def test_the_wall_of_a_lens_keeps_light_past_its_smaller_front_from_the_target():
    """A lens whose front is smaller than its rear has a wall in the way of a beam along the axis."""
    found = light_of(flat_problem(BEAM, GRID, {"front": {"half_width": (8, 8)}}))
    expected = np.where(RADII < 8, PLATE, np.where(RADII < 10, 0.0, 1.0)) * FULL
    assert np.all(found.irradiance[RADII > 10] == pytest.approx(FULL, rel=0.05))
    assert np.all(found.irradiance[RADII < 8] == pytest.approx(PLATE * FULL, rel=1e-6))
    assert found.metrics["past_elements"]["past_on_target"] == pytest.approx(
        expected[RADII > 10].sum(), rel=1e-3
    )


def test_the_verdict_fails_a_frame_around_even_light_and_says_how_to_hold_the_lens():
    problem = flat_problem(BEAM, GRID | {"lit": (10 / 12, 10 / 12)}).with_(**{"verify.rel_l2": 0.1})
    found = light_of(problem)
    verdict = found.verdict(problem.verify, loss_notes(found.metrics, System(problem).units))
    assert verdict.grade == "light misses"
    assert "--set lens.clear_aperture=[10,10]" in verdict.notes[-1]
    held = light_of(problem.with_(**{"lens.clear_aperture": (10, 10)}))
    assert all(check.result == "passed" for check in delivery_checks(held.metrics, problem.verify))


def test_no_light_is_followed_where_all_that_passes_the_lens_misses_the_target():
    """An LED of a hemisphere before a wide lens: what passes by goes aside."""
    led = {"kind": "lambertian", "half_width": (0.5, 0.5), "half_angle": 85.0, "distance": 2.0}
    metrics = light_of(flat_problem(led, {"distance": 100})).metrics
    assert metrics["fates_w"]["beside_lens"] > 0.01
    assert "past_elements" not in metrics
