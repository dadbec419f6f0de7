"""Positions of extremes as text."""

from optics.problem.manufacture_text import position
from thbcad.certified import Enclosure


def test_positions_on_an_axis_are_zero_and_not_what_rounding_left():
    text = position(Enclosure(lower=1.0, upper=1.0, value=1.0, u=-3.55e-15, v=12.34567))
    assert text == "at x = 0, y = 12.35 mm"
