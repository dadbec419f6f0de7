"""Colour maps: what Pillow reads of them is what was given, the right way up; pictures beside numbers: sizes
of frames, and names that are escaped."""

import re
from base64 import b64decode
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from thbcad.pictures import COLOURS, LONGEST, card, frame_size, interval_text, line_path, map_element


def pixels(element):
    """Return the colours of a map as (columns, rows, 3), u to the right and v upwards."""
    (png,) = re.findall(r'href="data:image/png;base64,([^"]*)"', element)
    image = Image.open(BytesIO(b64decode(png, validate=True)))
    image.verify()  # the check sums
    image = Image.open(BytesIO(b64decode(png)))
    return np.asarray(image.convert("RGB"), int)[::-1].swapaxes(0, 1)


def test_the_least_value_is_dark_and_the_greatest_bright_where_they_are():
    values = np.array([[0.0, 5.0, 2.5], [1.0, 4.0, -5.0]])
    seen = pixels(map_element(values, 30, 20))
    assert seen.shape == (2, 3, 3)
    assert seen[1, 2].tolist() == COLOURS[0].tolist()
    assert seen[0, 1].tolist() == COLOURS[-1].tolist()


def test_more_is_brighter():
    seen = pixels(map_element(np.linspace(3, 4, 256)[:, None], 256, 1))[:, 0]
    luminance = seen @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance) > -0.6).all()  # colours are whole numbers
    assert len(np.unique(seen, axis=0)) > 250


@pytest.mark.parametrize("value", [0.0, -7.0, 1e308])
def test_equal_values_have_one_colour(value):
    assert len(np.unique(pixels(map_element(np.full((4, 3), value), 4, 3)).reshape(-1, 3), axis=0)) == 1


def test_values_of_any_size_are_shown():
    seen = pixels(map_element(np.array([[-1e308, 1e308], [0.0, 5e-324]]), 2, 2))
    assert seen.shape == (2, 2, 3)


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
