"""The light of mapped cells on pixels, against exact rational areas."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given

from optics.base.runtime import OrderFreeSums, load_backend
from optics.light.measuring import pixel_lines
from optics.light.measuring.cut_cells import LEAST_AREA
from optics.scene.receivers import FarField, Plane, Screen
from tests.cases import examples, slow_unless
from tests.optics.cases import THREADS, on_threads
from tests.optics.light.measuring.cases import SCREENS, UNIT, sheet, shuffled, smooth, whole

SCREEN = whole(8, 6)
SQUARE = [[0.0, 0.0], [1.0, 1.0]], [[0.0, 1.0], [0.0, 1.0]]  # x and y of one cell's corners


def square(screen, x, y, width, height, **more):
    """Return one cell over a rectangle with its lower left corner at (x, y)."""
    return sheet(screen, x + width * np.array(SQUARE[0]), y + height * np.array(SQUARE[1]), **more)


def assert_exact(made, backend):
    found, expected = made.laid(backend), made.exact().astype(float)
    np.testing.assert_allclose(found, expected, rtol=0, atol=made.rounding())


@given(made=shuffled())
def test_pixels_hold_the_light_of_shuffled_cells(backend, made):
    """Corners anywhere: on pixel lines, flipped, folded onto a line or a point, beyond the screen."""
    assert_exact(made, backend)


@pytest.mark.every(3)
@pytest.mark.parametrize("case", slow_unless(lambda case: case[0] < 2, product(range(4), (0.3, 0.9, 2.3))))
def test_pixels_that_no_cell_meets_are_exactly_dark(backend, case):
    """Not what rounding leaves of bright ones beside them; and no pixel is darker than dark.  Slivers leave
    more, within `Sheet.rounding`."""
    seed, size = case
    made = smooth(whole(30, 26), (10, 9), size, 0.4, seed=seed, centre=(0.13, -0.28))
    found, dark = made.laid(backend), made.exact() == 0
    assert dark.any()
    assert not found[dark].any()
    assert found[~dark].min() > 0


@pytest.mark.parametrize("height", [2.0, -2.0])
def test_a_cell_without_area_is_laid_to_the_last_digit(backend, height):
    """One corner away from three: the width falls from its most at one end to nothing at the other."""
    assert_exact(sheet(SCREEN, np.zeros((2, 2)), [[0.0, height], [0.0, 0.0]]), backend)


@given(made=shuffled(sound=False))
def test_cells_with_a_corner_that_is_not_sound_are_dark(backend, made):
    """Wherever these corners are said to be."""
    expected = made.exact().astype(float)
    for nowhere in (0.0, np.nan, np.inf, -1e300):
        lost = np.isnan(made.passing)
        there = replace(made, x=np.where(lost, nowhere, made.x), y=np.where(lost, nowhere, made.y))
        np.testing.assert_allclose(there.laid(backend), expected, rtol=0, atol=made.rounding())


@pytest.mark.parametrize("nowhere", [np.nan, np.inf, -np.inf])
def test_a_corner_without_a_finite_position_is_not_sound(backend, nowhere):
    made = smooth(SCREEN, (3, 3))
    made.x[1, 1] = nowhere
    passing = made.passing.copy()
    passing[1, 1] = np.nan
    expected = replace(made, passing=passing).laid(backend)
    assert expected.sum() > 0
    np.testing.assert_array_equal(made.laid(backend), expected)


@pytest.mark.parametrize("size", [1e-3, 0.03, 0.4, 1.7])
@pytest.mark.parametrize("screen", SCREENS, ids=repr)
def test_the_screen_keeps_the_flux_of_cells_that_lie_on_it(backend, screen, size):
    """Far below and far above a pixel: 1e-12, a thousand roundings of positions of up to 12 pixels."""
    rows, columns = screen.padded
    counts = [max(1, min(40, int(0.7 * n / size))) for n in (columns, rows)]
    size = min(size, 0.7 * min(columns, rows))
    made = smooth(screen, counts, size)
    four = made.passing[1:, 1:] + made.passing[1:, :-1] + made.passing[:-1, 1:] + made.passing[:-1, :-1]
    assert made.laid(backend).sum() == pytest.approx((made.emitted * four / 4).sum(), rel=1e-12)


@examples(30)
@given(made=shuffled(steps=(64,)))
def test_light_does_not_depend_on_the_sign_of_the_map(backend, made):
    """Rows and columns of cells exchanged turn every triangle round: the same light."""
    assume(made.least_area() >= LEAST_AREA)  # of a flat one another edge of the same length may be taken
    other = None if made.turned is None else made.turned.T
    turned = replace(
        made, x=made.x.T, y=made.y.T, emitted=made.emitted.T, passing=made.passing.T, turned=other
    )
    np.testing.assert_allclose(turned.laid(backend), made.laid(backend), rtol=0, atol=2 * made.rounding())


def test_a_fold_adds_up(backend):
    """A sheet folded along its middle is twice as bright as its half."""
    i, j = np.meshgrid(np.arange(7.0), np.arange(5.0), indexing="ij")
    folded = sheet(SCREEN, 1.1 * np.abs(i - 3) - 2.7, 0.9 * j - 1.6).laid(backend)
    half = sheet(SCREEN, 1.1 * i[:4] - 2.7, 0.9 * j[:4] - 1.6).laid(backend)
    np.testing.assert_allclose(folded, 2 * half, rtol=0, atol=200 * UNIT)


@examples(30)
@given(made=shuffled(screens=[whole(16, 18)], steps=(1, 64)))
def test_whole_pixels_move_the_image(backend, made):
    """Two columns to the right, three rows up, where no light leaves the screen."""
    made = replace(made, x=made.x / 2, y=made.y / 2)  # within 6 columns and 6 rows of the middle
    expected = np.roll(made.laid(backend), (-3, 2), axis=(0, 1))
    found = made.moved(2.0, 3.0).laid(backend)
    np.testing.assert_allclose(found, expected, rtol=0, atol=2 * made.rounding())


@pytest.mark.parametrize(
    ("dx", "dy", "share"),
    [
        (4, 0, 0.5),
        (-4, 0, 0.5),
        (0, 3, 0.5),
        (0, -3, 0.5),
        (4.5, 3.5, 0.0625),
        (-4.5, -3.5, 0.0625),
        (9, 0, 0),
    ],
)
def test_light_beyond_the_screen_is_dropped(backend, dx, dy, share):
    """A square of 2 x 2 pixels across every border, and corners."""
    made = square(SCREEN, dx - 1, dy - 1, 2.0, 2.0)
    assert made.laid(backend).sum() == pytest.approx(share, abs=8 * UNIT)
    assert_exact(made, backend)


@pytest.mark.parametrize("size", [20.0, 1e3, 1e6, 1e9])
def test_a_cell_larger_than_the_screen_lights_all_pixels_alike(backend, size):
    """Positions are rounded to 1e-16 of the cell's size, pixels are 1."""
    found = square(SCREEN, -0.4 * size, -0.6 * size, size, size).laid(backend)
    np.testing.assert_allclose(found, size**-2, rtol=max(1e-14, 8 * UNIT * size))


@pytest.mark.parametrize("size", [1e160, 1e300, 1.7e308])
def test_cells_beyond_all_numbers_leave_no_light(backend, size):
    """Areas overflow; a screen of 48 pixels has a share below 1e-150 of the light."""
    found = square(SCREEN, -0.5 * size, -0.5 * size, size, size).laid(backend)
    assert 0 <= found.min() <= found.max() < 1e-150


@pytest.mark.parametrize("size", [1e-3, 1e-9, 5e-324, 0.0])
@pytest.mark.parametrize("at", [(0.25, 0.25), (0.0, 0.0), (0.0, 0.7), (-1.0, 2.0)])
def test_a_cell_within_a_pixel_is_its_light(backend, size, at):
    """Also where it begins on a pixel's corner; row 0 lies at +y, and a cell on a line counts for the pixel
    behind it."""
    found = square(SCREEN, at[0], at[1] - size, size, size).laid(backend)
    expected = np.zeros((6, 8))
    expected[int(3 - at[1]), int(4 + at[0])] = 1.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=8 * UNIT)


@pytest.mark.parametrize("height", [0.0, 0.9, 1.1])
def test_a_triangle_of_almost_no_area_is_laid_along_its_longest_edge(backend, height):
    """Three edges of 4, 1 and 3 pixels: thickness falls from the corner at -1 to both ends: pixels get
    1/4, 5/12, 3/12 and 1/12, whether the triangle has less than LEAST_AREA or a little more."""
    side = np.array([0.0, height * 2 * LEAST_AREA / 4])
    x, y = np.array([[-2.0, -2.0], [2.0, -1.0]]), np.array([[0.5, 0.5], [0.5, 0.5 + side[1]]])
    made = sheet(SCREEN, x, y, passing=np.array([[1.0, 1.0], [1.0, 1.0]]))
    found = made.laid(backend)
    assert_exact(made, backend)
    second = np.zeros(8)
    second[2] = 0.5  # the other triangle lies in one pixel: (-2, 0.5) twice and (-1, 0.5)
    wanted = second + np.array([0, 0, 3, 5, 3, 1, 0, 0]) / 24
    height_rounding = UNIT / side[1] if height > 1 else 0.0  # of positions, relative to the triangle's height
    np.testing.assert_allclose(found[2], wanted, rtol=0, atol=16 * UNIT + height_rounding)


@examples(30)
@given(made=shuffled(screens=[whole(4, 4)], steps=(1 << 12,)))
def test_slivers_around_the_least_area_hold_their_light(backend, made):
    """Cells 1 / 256 as high as wide: areas from 0 to 1e-2 square pixels.

    They lie within a row of pixels: on a border between two, cells thinner than LEAST_AREA belong to either.
    """
    assert_exact(replace(made, y=made.y / 256 + 0.375), backend)


@pytest.mark.parametrize("counts", [(1, 1), (1, 4), (5, 2)])
def test_no_flux_is_no_light(backend, counts):
    made = smooth(SCREEN, counts)
    assert not replace(made, emitted=np.zeros(counts)).laid(backend).any()
    assert not replace(made, passing=np.zeros(made.x.shape)).laid(backend).any()


@pytest.mark.parametrize(
    "screen", [Screen((45.0, 30.0), (7, 5), 2, FarField()), Screen((0.3, 7.0), (6, 9))], ids=repr
)
def test_pixels_of_any_size_hold_the_exact_light(backend, screen):
    """Degrees or mm; positions in pixels are rounded, as everything else is."""
    made = smooth(screen, (6, 5), 1.3, 0.9)
    assert_exact(replace(made, x=made.x * 1.1), backend)


def test_the_margin_sees_what_lies_beside_the_target(backend):
    """The same light in the middle, and around it what was dropped."""
    made = smooth(whole(4, 4), (6, 6), 1.2)
    wide = replace(made, screen=whole(4, 4, 3)).laid(backend)
    np.testing.assert_allclose(wide[3:-3, 3:-3], made.laid(backend), rtol=0, atol=made.rounding())
    assert wide.sum() > 1.5 * made.laid(backend).sum()


def test_irradiance_is_flux_by_area(backend):
    """One cell over a screen of 2 x 3 mm (or degrees): 5 W on 6 mm^2."""
    for angular in (False, True):
        made = square(
            Screen((1.0, 1.5), (4, 3), 0, FarField() if angular else Plane()),
            -1.0,
            -1.5,
            2.0,
            3.0,
            emitted=[[5.0]],
        )
        found = made.laid(backend) / made.screen.pixel_area
        np.testing.assert_allclose(found, 5 / 6, rtol=1e-14)


def test_single_precision_loses_no_more_than_its_numbers(backend):
    """Corners on 1/64 pixels are the same numbers; fluxes and the image are rounded to 6e-8."""
    made = smooth(whole(16, 12), (9, 9), 1.1, 0.7)
    made = replace(made, x=np.round(made.x * 64) / 64, y=np.round(made.y * 64) / 64)
    expected = made.laid(backend)
    np.testing.assert_allclose(
        made.laid(load_backend("single", 1)), expected, rtol=0, atol=1e-6 * expected.max()
    )


def test_any_number_of_threads_lays_the_same_light(backend):
    """32 000 cells, and some that are folded so that their triangles are as thin as can be."""
    made = smooth(whole(16, 12), (200, 160), 0.07, 0.9)
    images = [on_threads(threads, lambda: made.laid(backend)) for threads in THREADS]
    assert len({image.tobytes() for image in images}) == 1


def test_a_quantum_is_that_of_the_brightest_line(backend, monkeypatch):
    """With nine cells on a pixel, and triangles that are hardly thick enough to be followed: their summands
    are 1e8 times the light of a cell, and cancel.  Cells that lie across two lines count for both."""
    made, sums = smooth(whole(16, 12), (48, 36), 1 / 3, 0.0), []

    def kept(*arguments):
        sums.append(OrderFreeSums(*arguments))
        return sums[-1]

    made = replace(made, x=made.x.copy())
    made.x[21, 20] = made.x[20, 20] + 7 * LEAST_AREA
    assert LEAST_AREA < made.least_area() < 2 * LEAST_AREA
    monkeypatch.setattr(pixel_lines, "OrderFreeSums", kept)
    laid = made.laid(backend)
    assert 0 < sums[-1].quantum * 2.0**61 < 2 * laid.sum(axis=0).max()
    assert max(s.quantum for s in sums) < 1e-15 * laid.mean()
