"""The table [lens.body]: absent from what has none, and what is wrong with it in a sentence."""

import pytest

from optics.scene.problem import load_problem
from optics.scene.system import System
from tests.optics.cases import write_problem
from tests.optics.scene.problem.cases import refusal
from thbcad.moulds import BodyOptions

UNLIKE = {"lens.front.half_width": [8.0, 8.0]}


def test_a_body_is_read_and_a_problem_without_one_has_none(tmp_path):
    plain = load_problem(write_problem(tmp_path))
    assert System(plain).body is None
    keys = {"lens.body.draft": 2.0, "lens.body.annulus": True, "lens.body.parting": 1.0}
    body = load_problem(write_problem(tmp_path, UNLIKE | keys))
    assert System(body).body == BodyOptions(2.0, 1.0, True)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"annulus": True}, "front and rear have one half_width"),
        (UNLIKE | {"draft": 1.0}, "or of unlike ones with annulus = true"),
        ({"land": 1.0}, "lens.body.land has no effect with lens.body.annulus = false"),
        ({"draft": 46.0}, "lens.body.draft must be"),
        ({"draft": 1.0, "lens.outline": "ellipse"}, 'got "ellipse"'),
        ({"edge_radius": 0.1}, "an outline without sharp corners"),
    ],
    ids=str,
)
def test_a_body_whose_keys_do_not_go_together_is_refused(tmp_path, keys, words):
    keys = {key if key.startswith("lens.") else f"lens.body.{key}": value for key, value in keys.items()}
    assert words in refusal(load_problem, write_problem(tmp_path, keys))
