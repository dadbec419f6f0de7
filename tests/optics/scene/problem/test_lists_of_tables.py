"""Lists of tables, [[stop]]: read, changed by name or number, written, and what is wrong with them."""

import re

import pytest

from optics.base.runtime import UserError
from optics.scene.problem import Problem, assignment, load_problem
from tests.optics.scene.problem.cases import SMALL, load_text, one_sentence, toml_text

TWO = """
[[stop]]
name = "holder"
shape = "ellipse"
half_width = [8, 8]
position = [0, 0, -1]

[[stop]]
shape = "ring"
half_width = [3, 3]
inner = [1, 1]
position = [0, 0, 30]
hole = false
"""


@pytest.fixture
def two(tmp_path):
    return load_text(tmp_path, toml_text(SMALL) + TWO)


def test_tables_are_read_in_their_order_and_written_as_they_were_read(two, tmp_path):
    assert [stop.shape for stop in two.stop] == ["ellipse", "ring"]
    (tmp_path / "again.toml").write_text(two.to_toml(), encoding="utf-8")
    assert load_problem(tmp_path / "again.toml") == two
    assert "stop" not in two.with_(stop=()).to_toml()


@pytest.mark.parametrize(("entry", "k"), [("holder", 0), ("0", 0), ("1", 1)])
def test_a_table_is_named_by_its_name_or_its_number(two, entry, k):
    key, value = assignment(f"stop.{entry}.position=[1, 2, -3]", Problem)
    changed = two.with_(**{key: value})
    assert changed.stop[k].position == (1.0, 2.0, -3.0)
    assert changed.stop[1 - k] == two.stop[1 - k]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"stop.rim.hole": True}, "there is no stop.rim; there are holder, 1"),
        ({"stop.2.hole": True}, "there is no stop.2; there are holder, 1"),
        ({"stop.hole": True}, "stop is a list of tables: write stop.NAME.KEY"),
        ({"stop": {"shape": "ring"}}, "stop must be a list of tables, [[stop]], at most 1000"),
        ({"stop": [3]}, "stop[0] must be a table, got 3"),
        ({"stop": [{}]}, "the key stop[0].shape is missing"),
        ({"stop.1.shap": "ring"}, "unknown key stop[1].shap (did you mean stop.NAME.shape?)"),
        ({"stop.1.name": "holder"}, "stop[1].name must differ from that of stop[0], 'holder'"),
        ({"stop.1.name": "1.a"}, "stop[1].name must begin with a letter"),
        ({"stop.1.inner": (3, 1)}, "stop[1].inner must be above 0 and below stop[1].half_width"),
        ({"stop.holder.inner": (1, 1)}, "stop[0].inner is that of shape"),
        ({"stop.holder.shape": "hexagon"}, "stop[0].shape must be one of"),
        ({"lens.clear_aperture": (100, 3)}, "lens.clear_aperture must lie within front and rear"),
        ({"lens.clear_aperture": (0, 3)}, "lens.clear_aperture = [0.0, 3.0] leaves nothing"),
    ],
)
def test_what_is_wrong_with_a_list_is_said_in_a_sentence(two, changes, words):
    with pytest.raises(UserError, match=re.escape(words)) as caught:
        two.with_(**changes)
    assert one_sentence(str(caught.value))


@pytest.mark.parametrize("text", ["stop.holder.positon=[1]", "stop.position=[1, 2, 3]"])
def test_a_key_of_a_list_is_proposed_with_the_place_of_the_name(text):
    with pytest.raises(UserError, match=r"unknown key stop\..*\(did you mean stop\.NAME\.position\?\)"):
        assignment(text, Problem)
