"""Cells on two pixels and around a corner between four: closed forms in place of edges that are followed."""

from dataclasses import replace

import numpy as np
import pytest

from optics.light.measuring import whole_cells
from tests.optics.light.measuring.cases import sheet, smooth, whole

SCREEN = whole(16, 12, 1)


def folded(made):
    return replace(made, x=np.abs(made.x - 0.3))


@pytest.mark.parametrize(
    "made", [smooth(SCREEN, (40, 30), 0.45), folded(smooth(SCREEN, (40, 30), 0.45, 0.1))]
)
def test_closed_forms_are_what_edges_give(backend, made, monkeypatch):
    """Light, slopes and changes along a move, of cells whose areas exceed a hundredth: 1e-12 of each."""
    rng = np.random.default_rng(1)
    made = replace(made, turned=rng.random(made.emitted.shape) < 0.5)
    assert made.least_area() > 0.01
    g, moves = rng.standard_normal(SCREEN.padded), rng.standard_normal((3, *made.x.shape))
    closed, followed = [], []
    for found in (closed, followed):
        found += [made.laid(backend), *made.slopes(backend, g)[0], made.change(backend, *moves)]
        monkeypatch.setattr(whole_cells, "LEAST_AREA", np.inf)  # above which areas have closed forms
    for one, other in zip(closed, followed):
        assert not np.array_equal(one, other)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12 * np.abs(other).max())


def test_edges_are_hardly_ever_followed(backend):
    """Cells of 0.3 pixels, without any at the border: at most two corners of a cell lie in another pixel."""
    made = smooth(SCREEN, (40, 30), 0.3, 0.1)
    cells, (x, y, flux, sound) = made._inputs(backend)
    _, places = cells.image(cells.corners(*(v + n / 2 for v, n in ((y, 14), (x, 18))), flux, sound))
    assert backend.dr.width(places.corner) > 60
    assert backend.dr.width(places.cut) < 12


@pytest.mark.parametrize(("width", "height"), [(0.7, 0.9), (0.7, 0.2), (0.2, 0.9)])
def test_a_square_over_lines_has_the_shares_of_its_sides(backend, width, height):
    """From (0.6, 0.7) of a pixel on: 0.4 and 0.3 of a pixel lie before the lines, if it reaches them."""
    x, y = 0.6 + width * np.array([[0, 0], [1, 1]]), 0.7 + height * np.array([[0, 1], [0, 1]])
    found = sheet(whole(4, 4), x - 1, y - 1).laid(backend)
    before = [min(1.0, part / size) for part, size in ((0.4, width), (0.3, height))]
    (left, right), (low, high) = ((share, 1 - share) for share in before)
    expected = np.zeros((4, 4))
    expected[2, 1:3], expected[1, 1:3] = (low * left, low * right), (high * left, high * right)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)
