"""From which side a picture reads right."""

import json

import numpy as np
import pytest
from PIL import Image

from optics.base.runtime import UserError
from optics.interface.commands import main
from optics.scene.problem import load_problem
from optics.scene.system import load_system
from tests.optics.cases import TARGET_Z, picture, write_problem

pytestmark = pytest.mark.usefixtures("coarse_concentration")

LETTER = np.array([[0, 255, 0, 0], [0, 255, 0, 0], [0, 255, 255, 255]], np.uint8)  # an L beside the middle


def asked(folder, **target):
    """Return the light asked for at (x, y) of the scene, as a function."""
    changes = {f"target.{key}": value for key, value in target.items()}
    system = load_system(write_problem(folder, changes, LETTER))
    screen = system.target.screen()
    light = system.target.irradiance(screen, 1.0)
    (hx, hy), (rows, columns) = screen.half_width, light.shape

    def at(x, y):
        return light[int((hy - y) / (2 * hy) * rows), int((hx + x) / (2 * hx) * columns)]

    return at


def seen(eye, light, width=4, height=3):
    """Return what an eye at z sees of the target, y upward, as rows of bright and dark: by its own geometry.

    Right is the direction of sight times up: (0, 0, s) x (0, 1, 0) = (-s, 0, 0).
    """
    right = -np.sign(TARGET_Z - eye)
    x = right * (np.arange(width) + 0.5 - width / 2) * 40 / width
    y = (height / 2 - np.arange(height) - 0.5) * 40 / height
    return np.array([[light(a, b) for a in x] for b in y]) > 0


@pytest.mark.parametrize(("seen_from", "eye"), [("behind", 2 * TARGET_Z), ("lens", 0.0)])
def test_a_picture_reads_right_from_the_side_that_is_asked_for(tmp_path, seen_from, eye):
    light = asked(tmp_path, seen_from=seen_from, fit="stretch")
    np.testing.assert_array_equal(seen(eye, light), LETTER > 0)
    np.testing.assert_array_equal(seen(2 * TARGET_Z - eye, light), LETTER[:, ::-1] > 0)


@pytest.mark.parametrize("fit", ["crop", "pad", "stretch"])
@pytest.mark.parametrize("far", [False, True])
def test_nothing_else_changes(tmp_path, fit, far):
    shape = {"target.fit": fit, "target.half_width": [20.0, 12.0], "target.pixels": [47, 30]}
    if far:
        shape["target.distance"] = np.inf
    behind, lens = (
        load_system(write_problem(tmp_path, shape | {"target.seen_from": side}, picture(33, 61))).target
        for side in ("behind", "lens")
    )
    screen = behind.screen()
    np.testing.assert_allclose(
        lens.irradiance(screen, 2.0), behind.irradiance(screen, 2.0)[:, ::-1], rtol=1e-13, atol=0
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seen_from", "words"),
    [
        (
            "behind",
            "reads right from behind the target, looking at the lens; for a wall seen from the lens's",
        ),
        ("lens", "reads right from the lens's side, as on a wall; for a screen seen from behind: --set"),
    ],
)
def test_check_says_from_which_side(tmp_path, capsys, seen_from, words):
    path = str(write_problem(tmp_path, {"target.seen_from": seen_from}))
    assert main(["check", path, "--full"]) == 0
    assert words in capsys.readouterr().out
    assert main(["check", path, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["picture_seen_from"] == seen_from


def test_regions_and_formulas_have_no_side(tmp_path, capsys):
    path = str(write_problem(tmp_path, {"target.kind": "tophat"}))
    assert main(["check", path]) == 0
    assert "reads right" not in capsys.readouterr().out
    for changes in ({"target.kind": "tophat"}, {"target.kind": "function", "target.formula": "1 + x"}):
        with pytest.raises(UserError, match=r"target\.seen_from has no effect with target\.kind"):
            load_problem(write_problem(tmp_path, changes | {"target.seen_from": "lens"}))


def test_the_copy_of_the_picture_in_a_result_stays_the_picture(tmp_path):
    """The key turns it over whenever it is read, so the file must not be turned, too."""
    path = write_problem(tmp_path, {"target.seen_from": "lens"}, LETTER)
    light = load_system(path).target.light
    again = load_problem(path).to_toml()
    (tmp_path / "again.toml").write_text(again, "utf-8")
    np.testing.assert_array_equal(load_system(tmp_path / "again.toml").target.light, light)
    assert (np.asarray(Image.open(tmp_path / "picture.png")) == LETTER).all()
