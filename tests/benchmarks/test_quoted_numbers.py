"""Numbers that pages quote from stored rows: found by their marks, compared, refreshed."""

import pytest

from benchmarks.rows.quoted_numbers import marked_numbers, refreshed, rounded, without_marked_numbers
from benchmarks.rows.stored_rows import StoredRows
from optics.base.runtime import UserError


def row(name, value, unit=""):
    return {"name": name, "value": value, "unit": unit, "reference": "", "limit": None, "ok": True}


ROWS = [
    row("pearl: time", 12.7345, "s"),
    row("   difference", 3.2e-14),
    row("disk: functions", 2489),
    row("   difference", 0.0),
    row("share", 0.9214),
    row("twice", 1.0),
    row("twice", 2.0),
    row("unbounded", None),
]
STORED = {"tiny": StoredRows("tiny", "2026-11-20", {}, ROWS)}


@pytest.mark.parametrize(
    ("quoted", "wanted"),
    [
        ("12.7 s<!-- tiny: pearl: time -->", "12.7"),
        ("13<!-- tiny: pearl: time --> s", "13"),
        ("9 s<!-- tiny: pearl: time -->", "13"),
        ("12734 ms<!-- tiny: pearl: time -->", "12734"),
        ("3e-14<!-- tiny: pearl: time > difference -->", "3e-14"),
        ("3.20e-14<!-- tiny: pearl: time > difference -->", "3.20e-14"),
        ("2 489<!-- tiny: disk: functions -->", "2 489"),
        ("2489<!-- tiny: disk: functions -->", "2489"),
        ("1e-9<!-- tiny: disk: functions > difference -->", "0"),
        ("92.1 %<!-- tiny: share -->", "92.1"),
    ],
)
def test_a_quoted_number_is_the_stored_value_in_the_digits_shown(quoted, wanted):
    text = f"It takes {quoted}, at most."
    (found,) = marked_numbers(text, STORED)
    assert found.wanted == wanted
    assert refreshed(text, STORED) == text.replace(found.text, wanted, 1)
    marked = quoted[: quoted.index("-->") + 3]
    assert without_marked_numbers(text) == text.replace(marked, "")


@pytest.mark.parametrize(
    ("quoted", "reason"),
    [
        ("some<!-- tiny: share -->", "stands behind no number"),
        ("1<!-- other: share -->", "without stored rows"),
        ("1<!-- tiny: shares -->", "names 0 rows"),
        ("1<!-- tiny: twice -->", "names 2 rows"),
        ("1 mm<!-- tiny: pearl: time -->", "shows the unit 'mm', the row has 's'"),
        ("1<!-- tiny: unbounded -->", "without a finite value"),
    ],
)
def test_a_mark_that_leads_nowhere_is_refused(quoted, reason):
    with pytest.raises(UserError, match=reason):
        marked_numbers(quoted, STORED)


def test_other_comments_are_no_marks():
    assert marked_numbers("5 mm <!-- a remark --> 6 mm", STORED) == []


@pytest.mark.parametrize(
    ("value", "like", "wanted"),
    [
        (9.96, "9.5", "10.0"),
        (-1.0, "-2.0", "-1.0"),
        (-1e-9, "0.0", "0.0"),
        (5.46e5, "5.5e5", "5.5e5"),
        (1234567.0, "12 345", "1 234 567"),
    ],
)
def test_rounding_keeps_the_form_of_a_number(value, like, wanted):
    assert rounded(value, like) == wanted
