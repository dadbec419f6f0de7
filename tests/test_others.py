"""The cases of others: their problem files can be designed, and their pictures are what the script makes."""

from math import degrees, sqrt

import numpy as np
import pytest
from PIL import Image

from optics.scene.problem import load_problem
from optics.scene.system import load_system
from tests.cases import EXAMPLES, module_at

OTHERS = EXAMPLES / "others"
FILES = sorted(OTHERS.glob("*.toml"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_case_is_a_short_problem_that_can_be_solved(path):
    assert len(path.read_text("utf-8").splitlines()) <= 40
    assert load_system(path).target.light.max() > 0


def test_the_pictures_are_those_of_the_script():
    """The text is left out: its letters are those of the installed Pillow."""
    script = module_at(OTHERS / "pictures.py")
    made = {
        "pearl_padded": script.padded(),
        "astronaut": script.photograph(),
        "pearl_far": script.reachable(Image.open(EXAMPLES / "pearl.png")),
    }
    for name, picture in made.items():
        np.testing.assert_array_equal(np.asarray(Image.open(OTHERS / f"{name}.png")), np.asarray(picture))


def test_the_padded_picture_has_their_frame():
    light = np.asarray(Image.open(OTHERS / "pearl_padded.png"))
    assert light.shape == (306, 306)
    assert light[25:-25, 25:-25].mean() > 20
    assert light.sum() == light[25:-25, 25:-25].sum()


def test_the_beam_of_the_square_is_theirs():
    """exp(-0.035 rho^2) within rho < 4 mm; the index is that of BAK1 over that of air at 589 nm."""
    source = load_problem(OTHERS / "flat_square.toml").source
    assert source.sigma[0] * source.half_width[0] == pytest.approx(sqrt(1 / (2 * 0.035)), rel=1e-6)
    assert source.profile == "round_gaussian"


def test_the_cone_of_the_picture_is_theirs():
    source = load_problem(OTHERS / "picture_in_a_cone.toml").source
    assert source.divergence == pytest.approx(degrees(0.02), rel=1e-6)
    assert source.divergence_profile == "theta_uniform"
