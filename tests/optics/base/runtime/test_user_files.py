"""Names of files that Windows refuses."""

import pytest

from optics.base.runtime import UserError, require_file_name

NAMES = [
    "CON",
    "nul",
    "Com1",
    "LPT9.front",
    "aux .x",
    "L1.",
    "L1 ",
    "a:b",
    'a"b',
    "a/b",
    "a\\b",
    "a\tb",
    "what?",
]


@pytest.mark.parametrize("name", NAMES)
def test_names_that_windows_refuses_are_refused_everywhere(name):
    with pytest.raises(UserError, match=r"would name files that Windows does not take: .*; take another"):
        require_file_name("element[0].name =", name, "take another")


@pytest.mark.parametrize("name", ["L1", "console", "com", "com10", "Linse è 3", ".x", "a.b", "null"])
def test_other_names_are_taken(name):
    require_file_name("element[0].name =", name, "take another")
