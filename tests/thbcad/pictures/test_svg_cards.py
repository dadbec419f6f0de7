"""Pictures beside numbers: sizes of frames, and names that are escaped."""

import numpy as np
import pytest

from thbcad.pictures.svg_pictures import LONGEST, card, frame_size, interval_text, line_path


@pytest.mark.parametrize(
    ("sides", "pixels"),
    [((2, 1), (1, 0.5)), ((3, 3), (1, 1)), ((1, 100), (0.25, 1)), ((1e300, 1), (1, 0.25))],
)
def test_a_frame_has_the_shape_of_its_rectangle_but_is_never_slim(sides, pixels):
    assert frame_size(*sides) == tuple(LONGEST * p for p in pixels)


def test_names_and_values_are_escaped():
    html = card("a < b", "<svg/>", [("x & y", "<script>")])
    assert "<b>a &lt; b</b>" in html
    assert "x &amp; y" in html
    assert "<script>" not in html


def test_lines_and_intervals_are_short():
    assert line_path(np.array([[0.04, 1.0], [2.25, 1e2]])) == "M0.0 1.0L2.2 100.0"
    assert interval_text(-1 / 3, 2000.0, "mm") == "-0.3333 to 2000 mm"
    assert interval_text(0, 1) == "0 to 1"
