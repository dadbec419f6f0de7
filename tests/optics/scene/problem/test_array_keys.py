"""The table [lens.array]: absent from what has none, and what is wrong with it in a sentence."""

import pytest

from optics.scene.problem import load_problem
from tests.optics.cases import write_problem
from tests.optics.scene.problem.cases import refusal

PLATE = {"lens.array.columns": 2, "lens.array.rows": 3, "lens.array.pitch": 25.0}


def test_a_pitch_is_one_number_or_two_and_a_problem_without_a_plate_has_none(tmp_path):
    assert load_problem(write_problem(tmp_path)).lens.array is None
    assert "array" not in load_problem(write_problem(tmp_path)).to_toml()
    one = load_problem(write_problem(tmp_path, PLATE)).lens.array
    two = load_problem(write_problem(tmp_path, PLATE | {"lens.array.pitch": [25, 24.0]})).lens.array
    assert (one.count, one.pitches, two.pitches) == (6, (25.0, 25.0), (25.0, 24.0))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"lens.array.columns": 0}, "lens.array.columns must be at least 1"),
        ({"lens.array.rows": 1.5}, "lens.array.rows must be a whole number"),
        ({"lens.array.pitch": 20.0}, "lens.array.pitch must be greater than the lens is wide, 20 mm in x"),
        ({"lens.array.pitch": [25.0, 19.0]}, "20 mm in y, so that there is land between the lenses; got 19"),
        ({"lens.array.pitch": [25.0, 25.0, 1.0]}, "lens.array.pitch must be one number, or those of x and y"),
        ({"lens.outline": "round"}, "leave out lens.outline, or it"),
        ({"lens.body.draft": 2.0}, "leave out lens.body, or it"),
        ({"lens.rear.reflectance": 0.01}, "leave out the reflectance of front and rear"),
        ({"lens.clear_aperture": [8.0, 8.0]}, "leave out lens.clear_aperture"),
        (
            {"stop": [{"shape": "rectangle", "half_width": [3.0, 3.0], "position": [0, 0, -2.0]}]},
            "leave out [[stop]]",
        ),
        (
            {
                "target.kind": "zones",
                "target.zone": [{"points": [[0, 0]], "least": 1.0}],
                "source.unit": "lm",
            },
            "give source.flux the light of all lenses",
        ),
        ({"target.tilt": [10.0, 0, 0]}, "leave out target.position, target.tilt and target.radius"),
    ],
    ids=str,
)
def test_a_plate_whose_keys_do_not_go_together_is_refused(tmp_path, keys, words):
    assert words in refusal(load_problem, write_problem(tmp_path, PLATE | keys))


def test_a_plate_is_that_of_a_lens_on_the_axis(tmp_path):
    own = load_problem(write_problem(tmp_path, PLATE))
    lens = {"kind": "lens", "name": "L1", **{k: v for k, v in vars(own.lens).items() if k != "front"}}
    place = {"target.distance": False, "target.position": [0, 0, 90.0]}
    told = refusal(own.with_, lens=False, element=[lens | {"front": own.lens.front}], **place)
    assert "element.L1.array is that of a lens on the axis" in told
