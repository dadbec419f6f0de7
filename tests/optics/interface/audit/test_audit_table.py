"""An audit as a table and as data."""

from dataclasses import replace

import pytest

from optics.interface.audit import CLAIMS, Judged, audit_data, audit_lines
from optics.interface.audit.audit_table import CLAIMED, HERE, WIDTH
from optics.interface.audit.claims import Measured
from optics.interface.audit.numbers import loops, percent, power

HELD = Measured(8.27e-4, "0.083 %", True)
MISSED = Measured(3e-3, "0.3 %", False, "the light misses it")
UNTRIED = Measured(None, "not tried", None, 'optiland is not installed; pip install "thbcad[verify]"')
LIGHT, LANDING = (next(c for c in CLAIMS if c.key == key) for key in ("light", "landing"))


def test_the_table_has_the_result_first_and_the_details_last():
    rows = [Judged(LIGHT, HELD), Judged(LIGHT, MISSED), Judged(LANDING, UNTRIED)]
    assert audit_lines(rows, 61.7) == [
        "1 of 3 claims hold here, 1 not tried                                        62 s",
        "",
        f"    {'claimed':50} here                  ok",
        f" 1  {'Uniform square: error at most 0.1 %':50} 0.083 %               yes",
        f" 2  {'Uniform square: error at most 0.1 %':50} 0.3 %                 no",
        " 3  optiland's rays land within 10⁻⁸ mm                not tried             -",
        "",
        " 2  the light misses it",
        ' 3  optiland is not installed; pip install "thbcad[verify]"',
    ]


def test_every_line_has_at_most_80_columns():
    long = Measured(1.0, "x" * HERE, False, "word " * 60)
    lines = audit_lines([Judged(claim, long) for claim in CLAIMS], 1e3)
    assert max(map(len, lines)) <= WIDTH == 80
    assert max(len(claim.claimed) for claim in CLAIMS) <= CLAIMED


@pytest.mark.parametrize(("found", "ok"), [(HELD, True), (MISSED, False), (UNTRIED, False)])
def test_an_audit_is_whole_where_every_claim_was_tried_and_holds(found, ok):
    data = audit_data([Judged(LIGHT, HELD), Judged(LIGHT, found)], 1.0)
    assert data["ok"] is ok
    assert data["claims"][1]["holds"] is found.holds
    assert data["claims"][0] == {
        "number": 1,
        "key": "light",
        "claimed": "Uniform square: error at most 0.1 %",
        "limit": 1e-3,
        "value": 8.27e-4,
        "here": "0.083 %",
        "holds": True,
        "remark": "",
    }


def test_the_limit_of_a_claim_stands_in_its_sentence():
    assert CLAIMS[0].claimed == "First design: 9 calibration loops, at most 18"
    assert replace(LIGHT, limit=0.02).claimed == "Uniform square: error at most 2 %"


@pytest.mark.parametrize(
    ("shown", "text"),
    [
        (loops(18.0), "18"),
        (loops(7.123), "7.1"),
        (loops(123.4), "123"),
        (percent(8.27e-4), "0.083 %"),
        (percent(0.1), "10 %"),
        (power(1e-10, "mm"), "10⁻¹⁰ mm"),
        (power(1.78e-14), "2 × 10⁻¹⁴"),
        (power(0.0, "mm"), "0 mm"),
    ],
)
def test_numbers_are_written_for_people(shown, text):
    assert shown == text
