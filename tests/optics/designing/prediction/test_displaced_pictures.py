"""What is expected of a plate before a plane: the sum of the displaced pictures, as it is measured."""

import numpy as np
import pytest

from optics.designing.prediction import displaced_limits, displaced_sentence, expectation_lines, expected
from optics.designing.prediction.start_light import light_before
from optics.light.analysis import measure
from tests.optics.cases import small_system

PLATE = {"lens.array.columns": 2, "lens.array.rows": 1, "lens.array.pitch": 25.0, "lens.thickness": 8.0}
NEAR = PLATE | {"target.half_width": [20.0, 20.0], "target.pixels": [32, 32], "target.distance": 60.0}


def test_the_start_of_a_plate_is_as_far_off_as_its_lenses_together(tmp_path, backend):
    """The estimates of check and measurement differ by the size of their cells."""
    system = small_system(tmp_path, NEAR)
    fates, error = light_before(system, backend)
    found = measure(system, backend).metrics
    assert error == pytest.approx(found["rel_l2"], rel=0.02)
    assert fates.on_target / system.problem.flux == pytest.approx(found["efficiency"], rel=1e-3)
    assert fates.off_target / system.problem.flux == pytest.approx(found["stray"], abs=1e-3)
    assert found["stray"] > 0.1


@pytest.mark.parametrize("pixels", [4.0, 3.0])
def test_two_lenses_halve_the_light_at_the_borders_of_a_picture(tmp_path, pixels):
    """A pitch of p pixels takes half of the light of p / 2 columns at each border, and lays it down beside.
    Of half a column that is a quarter."""
    width = 25.0 / pixels
    keys = {"target.kind": "tophat", "target.pixels": [32, 32], "target.half_width": [16 * width, 16 * width]}
    found = displaced_limits(small_system(tmp_path, PLATE | keys | {"target.lit": [0.5, 0.5]}))
    missing = [0.5] * int(pixels / 2) + [0.25] * int(pixels % 2)
    assert found.plain == pytest.approx(np.sqrt(4 * np.square(missing).sum() / 16), rel=1e-6)
    assert found.pixels == pytest.approx((pixels, 0.0))
    assert found.least < found.plain / 1.5


@pytest.mark.slow
def test_a_plate_that_spoils_its_picture_names_what_helps(tmp_path, backend):
    system = small_system(tmp_path, NEAR | {"lens.rear.freeform.z_freedom": 5.0})
    lines = "\n".join(expectation_lines(system, expected(system, backend)[0]))
    assert "not predicted for a plate, whose pictures are displaced; the start of all lenses has" in lines
    said = displaced_sentence(displaced_limits(system), 0.2)
    assert "lie up to 25 x 0 mm apart (20 x 0 pixels)" in said
    assert "this plate has 0.2; a larger target, as much further away," in said


def test_one_lens_and_the_far_field_displace_nothing(tmp_path):
    far = {"target.distance": np.inf, "target.half_width": [60.0, 60.0]}
    assert displaced_limits(small_system(tmp_path)) is None
    assert displaced_limits(small_system(tmp_path, PLATE | far)) is None
