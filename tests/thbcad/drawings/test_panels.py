"""A panel of texts beside the views: on the paper whatever it says, with the clear apertures in the plans."""

import numpy as np
import pytest

from tests.thbcad.drawings.cases import BALL, PLAIN
from thbcad.drawings import Grid, Panel, Style, lens_sheet
from thbcad.outlines import Outline

X = np.linspace(-1, 1, 5)


def panel(rows, clear):
    grid = Grid("sag, mm", X, 2 * X, np.outer(X, X) - 4e-5)
    return Panel("Indications", rows, (grid, grid), ("nothing is claimed",), clear)


@pytest.mark.parametrize("count", [3, 40])
def test_a_panel_stands_right_of_the_drawing_and_leaves_it_as_it_is(count):
    round_ = Outline.ellipse((2.0, 1.5))
    rows = tuple((f"name.{k}", "a text that is longer than one line " * 4, "open") for k in range(count))
    plain, wide = lens_sheet(PLAIN), lens_sheet(PLAIN, panel=panel(rows, (round_, round_)))
    assert wide.size == (594.0, 297.0)
    assert wide.scale == plain.scale
    own = {label for label in wide.labels if label.position[0] > 410}
    assert {label.text for label in wide.labels if label not in own} == {
        label.text.replace("A3", "A3.2") for label in plain.labels
    }
    assert all(10 < label.position[1] < 287 for label in own)
    for label in own:
        ends = label.position[0] + label.length * np.array([0, 1] if label.anchor == "start" else [-1, 0])
        assert (ends > 410).all()
        assert (ends < 584).all()
    names = sorted(label.position[1] for label in own if label.text.startswith("name."))
    assert len(names) == count
    assert np.diff(names).min() > 1.5 * next(iter(own)).height or count == 3
    assert {label.text for label in own} >= {"open", "1.0000", "0.2500", "0.0000", "nothing is claimed"}


def test_heights_have_no_negative_zero():
    outline = Outline((1.0, 1.0))
    texts = [label.text for label in lens_sheet(PLAIN, panel=panel((), (outline, outline))).labels]
    assert "-0.0000" not in texts
    assert texts.count("0.0000") == 18


def test_clear_apertures_stand_in_the_plans():
    front, rear = Outline((2.0, 1.0), (0.5, 0.5)), Outline.ellipse((3.0, 3.0))
    sheet, plain = lens_sheet(BALL, panel=panel((), (front, rear))), lens_sheet(BALL)
    old = {stroke.points.tobytes() for stroke in plain.strokes}
    rings = [s.points for s in sheet.strokes if s.style is Style.CENTRE and s.points.tobytes() not in old]
    for ring, one, outline in zip(rings, (sheet.views[0], sheet.views[3]), (front, rear), strict=True):
        points = (ring - one.origin) / sheet.scale
        np.testing.assert_allclose(outline.gauge(*points.T), 1, atol=1e-9)
        np.testing.assert_allclose(np.ptp(points, axis=0), 2 * np.array(outline.half_width), atol=2e-3)
