"""Values of JSON files: what no reader takes is refused with the name of the file."""

import pytest

from thbcad.checks import shown
from thbcad.io.json_values import read_json


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            '{"a": ' + "1" * 10_000 + "}",
            r"a\.json is not a lens file: it holds an integer of too many digits$",
        ),
        ('{"a": 1, "a": 2}', r"a\.json is not a lens file: its key 'a' stands twice"),
        ("[" * 100_000, r"a\.json is not a lens file: it is nested too deeply"),
    ],
)
def test_refusals_name_the_file(tmp_path, text, words):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(ValueError, match=words):
        read_json(tmp_path / "a.json", "lens")


def test_long_integers_in_lists_are_shown_by_their_kind():
    assert shown([10**5000]) == "a list with an integer of too many digits to show"
