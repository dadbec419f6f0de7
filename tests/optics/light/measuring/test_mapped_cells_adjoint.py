"""The derivatives of the light of mapped cells, by its corners and by their flux."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import Phase, assume, given, strategies as st

from optics.base.runtime import load_backend
from optics.light.measuring.cut_cells import LEAST_AREA
from optics.scene.sources import corner_flux
from oracles.exact_cells import exact_slopes
from tests.cases import examples, slow_unless
from tests.optics.cases import THREADS, on_threads
from tests.optics.light.measuring.cases import SCREENS, UNIT, sheet, shuffled, smooth, whole

SCREEN = whole(8, 6, 1)


def weights(screen, seed=0):
    return np.random.default_rng(seed).standard_normal(screen.padded)


def passing_all(made):
    return replace(made, passing=np.ones(made.x.shape))


@pytest.mark.slow
@examples(8, phases=[Phase.generate])  # to shrink an example would take minutes
@given(made=shuffled(screens=SCREENS[:2], steps=(512,)), seed=st.integers(0, 99))
def test_slopes_are_exact_on_shuffled_cells(backend, made, seed):
    """Where all areas exceed 1e-3: a slope is a sum of terms f / A times positions of up to 12 pixels, each
    rounded to 1e-16, and of f / A^2 times their squares: 1e-16 * 144 / 1e-3^2 = 1e-8 of the flux."""
    made = passing_all(made)
    assume(made.least_area() > 1e-3)
    g = weights(made.screen, seed)
    (by_x, by_y, _), _ = made.slopes(backend, g)
    exact = exact_slopes(made.screen, made.x, made.y, made.emitted, g, made.turned)
    for found, expected in zip((by_x, by_y), exact):
        np.testing.assert_allclose(found, expected.astype(float), rtol=0, atol=1e-8)


CELLS = list(product((0.6, 1.3, 4.0), (False, True)))  # size, fold
TURNED = np.kron([[False, True], [True, False]], np.ones((2, 2), dtype=bool))[:3, :3]  # as on a cone's middle


@pytest.mark.every(3)
@pytest.mark.parametrize("case", slow_unless(((0.6, False), (1.3, True), (4.0, False)).__contains__, CELLS))
def test_slopes_are_exact_where_areas_exceed_a_thousandth(backend, case):
    """Smooth cells, of which four are turned: 1e-8 of the greatest slope, as is claimed."""
    size, fold = case
    made = replace(passing_all(smooth(SCREEN, (3, 3), size, 0.3, seed=1)), turned=TURNED)
    if fold:
        made = replace(made, x=np.abs(made.x - 0.3))
    assert made.least_area() > 1e-3
    g = weights(SCREEN)
    (by_x, by_y, _), _ = made.slopes(backend, g)
    for found, expected in zip((by_x, by_y), exact_slopes(SCREEN, made.x, made.y, made.emitted, g, TURNED)):
        expected = expected.astype(float)
        assert np.abs(expected).max() > 0.01
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("jitter", [0.2, 2.0], ids=["smooth", "shuffled"])
def test_slopes_are_those_of_the_image(backend, jitter):
    """Central differences of many cells along random directions, of the length 1 per corner.

    With areas A > 0.01 and slopes f / A^2 or so, h = 1e-6 errs by h^2 / A^2 of a slope (third derivatives),
    and by 1e-16 R A / h of it (positions of R = 24 pixels are rounded): below 1e-7 both.
    """
    made = smooth(whole(20, 24, 2), (16, 14), 1.2, jitter, seed=3)
    made = replace(made, emitted=np.where(_least_areas(made) > 1e-2, made.emitted, 0.0))
    assert (made.emitted > 0).mean() > 0.8
    g, rng, h = weights(made.screen), np.random.default_rng(4), 1e-6
    (by_x, by_y, _), _ = made.slopes(backend, g)
    for _ in range(5):
        dx, dy = rng.standard_normal((2, *made.x.shape))
        ahead, behind = ((made.moved(s * h * dx, s * h * dy).laid(backend) * g).sum() for s in (1, -1))
        slope = (by_x * dx).sum() + (by_y * dy).sum()
        scale = np.sqrt((by_x**2).sum() + (by_y**2).sum())
        assert (ahead - behind) / (2 * h) == pytest.approx(slope, abs=1e-6 * scale)


def _least_areas(made):
    """Return the least area of the two triangles of every cell, square pixels."""

    def area(u, v):
        return np.abs(u[0] * v[1] - u[1] * v[0]) / 2

    (dx, ax, bx), (dy, ay, by) = (
        (c[1:, 1:] - c[:-1, :-1], c[1:, :-1] - c[:-1, :-1], c[:-1, 1:] - c[:-1, :-1])
        for c in (made.x, made.y)
    )
    return np.minimum(area((dx, dy), (ax, ay)), area((dx, dy), (bx, by)))


@given(made=shuffled(steps=(1, 2, 64)), seed=st.integers(0, 99))
def test_the_adjoint_by_flux_is_that_of_a_linear_map(backend, made, seed):
    """sum g E = sum dL/df f: the image is linear in the flux, where no triangle is laid across pixels."""
    assume(made.least_area() >= LEAST_AREA)
    g = weights(made.screen, seed)
    (_, _, by_flux), total = made.slopes(backend, g)
    assert (by_flux * made.passing * corner_flux(made.emitted)).sum() == pytest.approx(
        total, abs=made.rounding() * np.abs(g).sum() * made.x.size
    )


def test_a_uniform_weight_leaves_the_corners_alone(backend):
    """Light that stays on the screen is neither made nor lost: the sum of all pixels has no slope."""
    made = smooth(SCREEN, (5, 4), 1.0)
    (by_x, by_y, by_flux), _ = made.slopes(backend, np.ones(SCREEN.padded))
    assert max(np.abs(by_x).max(), np.abs(by_y).max()) < 1e-12
    # a corner's flux stands for quarters of the cells around; each passes on what its corners do, in the mean
    np.testing.assert_allclose(by_flux[1:-1, 1:-1], 1.0, rtol=1e-12)


@pytest.mark.every(2)
@pytest.mark.parametrize("size", slow_unless((0.7, 1.3).count, (0.7, 1.3, 2.5)))
def test_slopes_of_even_light_are_exact(backend, size):
    """Neighbours of one density: their edge adds nothing to the image, and yet both have it as a border."""
    along = np.arange(-2, 3) * size
    made = sheet(whole(8, 6, 1), *np.meshgrid(along + 0.1, along - 0.2, indexing="ij"))
    g = weights(made.screen)
    (by_x, by_y, by_flux), total = made.slopes(backend, g)
    assert (by_flux * corner_flux(made.emitted)).sum() == pytest.approx(total, abs=1e-12)
    exact = exact_slopes(made.screen, made.x, made.y, made.emitted, g)
    for found, expected in zip((by_x, by_y), exact):
        np.testing.assert_allclose(found, expected.astype(float), rtol=0, atol=1e-12)


def test_a_shift_of_all_corners_moves_light_over_the_borders(backend):
    """A square over the border between two pixels: moving it by d carries d / width of its light across."""
    made = sheet(whole(4, 4), [[-0.3, -0.3], [0.4, 0.4]], [[0.1, 0.9], [0.1, 0.9]])
    g = np.zeros((4, 4))
    g[1, 2] = 1.0
    (by_x, by_y, _), total = made.slopes(backend, g)
    assert total == pytest.approx(4 / 7, rel=1e-14)
    assert by_x.sum() == pytest.approx(1 / 0.7, rel=1e-13)
    assert np.abs(by_y.sum()) < 1e-13


def test_light_in_one_pixel_has_no_slope_but_by_flux(backend):
    made = sheet(whole(4, 4), [[0.2, 0.2], [0.7, 0.7]], [[0.1, 0.9], [0.1, 0.9]])
    g = weights(made.screen)
    (by_x, by_y, by_flux), _ = made.slopes(backend, g)
    assert not by_x.any()
    assert not by_y.any()
    np.testing.assert_allclose(by_flux, g[1, 2], rtol=1e-14)


@pytest.mark.parametrize(("dx", "dy"), [(9.0, 0.0), (-9.0, 0.0), (0.0, 8.0), (0.0, -8.0), (7.3, 6.1)])
def test_light_beside_the_screen_leaves_no_rounding(backend, dx, dy):
    """Zeros, not what is left of large terms: the optimiser scales its variables by such numbers."""
    made = smooth(SCREEN, (4, 4), 0.7, seed=2, centre=(dx, dy))
    assert not made.laid(backend).any()
    assert not any(slope.any() for slope in made.slopes(backend, weights(SCREEN))[0])


@pytest.mark.parametrize("height", [0.0, 0.99, 1.01])
def test_corners_of_triangles_below_the_least_area_pass_no_slope(backend, height):
    """The clamp: a sliver across four pixels moves its light with its corners, and yet has no slope by them;
    by the flux it has the weight in the pixel of its middle.  From LEAST_AREA on both are the exact ones."""
    top = 0.5 + height * 2 * LEAST_AREA / 3.1
    made = sheet(whole(4, 4), [[-1.6, -1.6], [1.5, 1.5]], [[0.5, top], [0.5, top]])
    g = weights(made.screen)
    (by_x, by_y, by_flux), _ = made.slopes(backend, g)
    moved = (made.moved(1e-3, 0.0).laid(backend) * g).sum() - (made.laid(backend) * g).sum()
    assert abs(moved) > 1e-6
    if height < 1:
        assert not by_x.any()
        assert not by_y.any()
        # the middles of the triangles lie at 0.47 and -0.57, and the corners 0 and 3 belong to both
        np.testing.assert_allclose(by_flux, [[(g[1, 1] + g[1, 2]) / 2] * 2] * 2, rtol=1e-13)
    else:
        assert 1e-3 * by_x.sum() == pytest.approx(moved, rel=1e-3)


@pytest.mark.parametrize("area", [1e-4, 1e-5, 1e-6, 1e-7])
def test_slopes_of_slivers_are_exact(backend, area):
    """A cell on a corner of pixels with triangles of this area A and length L, of half the light each: their
    mean weight is off by roundings of up to 4 pixels times L / A, their slopes by that times L / A."""
    along = np.array([[-0.125, -0.125], [0.09375, 0.09375]])
    made = sheet(whole(4, 4), along, 0.375 * along + np.array([0.0, area / 0.21875 * 2]) - 0.00390625)
    assert made.least_area() == pytest.approx(area, rel=1e-6)
    g = weights(made.screen)
    (by_x, by_y, _), _ = made.slopes(backend, g)
    rounding = 16 * 4 * UNIT * 0.22**2 / area**2
    for found, expected in zip((by_x, by_y), exact_slopes(made.screen, made.x, made.y, made.emitted, g)):
        expected = expected.astype(float)
        assert np.abs(expected).max() > 0.1
        np.testing.assert_allclose(found, expected, rtol=0, atol=rounding)


@pytest.mark.parametrize("height", [None, 1e-4, 1e-6])
def test_the_change_along_a_move_is_the_slope_along_it(backend, height):
    """Forward is the transpose of backward, also of a sliver of this height: both round what is as large as
    the light by its area squared."""
    made, rng = smooth(whole(16, 12), (12, 9), 1.1, 0.3, seed=5), np.random.default_rng(6)
    made = replace(made, turned=rng.random(made.emitted.shape) < 0.5)
    if height is not None:
        made.y[3, 3] = made.y[3, 4] - height
    g, moves = weights(made.screen), [rng.standard_normal(made.x.shape) for _ in range(3)]
    rounding = 1e-12 if height is None else 16 * 16 * UNIT / height**2
    change = made.change(backend, *moves)
    (by_x, by_y, by_flux), _ = made.slopes(backend, g)
    expected = sum((slope * move).sum() for slope, move in zip((by_x, by_y, by_flux), moves))
    assert (change * g).sum() == pytest.approx(expected, abs=rounding * np.abs(g).sum())


def test_the_change_beside_a_sliver_is_that_without_it(backend):
    """In columns that it does not meet: its own changes by 1e6, and that is all that scales the quantum."""
    made, rng = smooth(whole(16, 12), (12, 9), 1.1, 0.3, seed=5), np.random.default_rng(6)
    made.y[3, 3] = made.y[3, 4] - 1e-6
    dark = made.emitted.copy()
    dark[2:4, 3] = 0.0
    moves = [*rng.standard_normal((2, *made.x.shape)), np.zeros(made.x.shape)]
    found, expected = (case.change(backend, *moves) for case in (made, replace(made, emitted=dark)))
    beside = np.arange(16) > made.x[2:5, 3:5].max() + 8
    assert 6 < beside.sum() < 14
    np.testing.assert_allclose(found[:, beside], expected[:, beside], rtol=0, atol=1e-9)


@pytest.mark.parametrize("nowhere", [0.0, np.nan, np.inf, 1e300])
def test_a_corner_that_is_not_sound_has_no_slope_and_spoils_none(backend, nowhere):
    made = smooth(SCREEN, (4, 4))
    lit = made.emitted.copy()
    lit[1:3, 1:3] = 0.0  # the cells around the lost corner, as if they were dark
    g = weights(SCREEN)
    expected, total = replace(made, emitted=lit).slopes(backend, g)
    lost = np.zeros(made.x.shape, dtype=bool)
    lost[2, 2] = True
    there = replace(made, passing=np.where(lost, np.nan, made.passing), x=np.where(lost, nowhere, made.x))
    (by_x, by_y, by_flux), same = there.slopes(backend, g)
    assert same == pytest.approx(total, rel=1e-13)
    np.testing.assert_allclose([by_x, by_y], expected[:2], rtol=0, atol=1e-13)
    assert [by_x[2, 2], by_y[2, 2], by_flux[2, 2]] == [0, 0, 0]


def test_slopes_on_any_number_of_threads_are_the_same(backend):
    made = smooth(whole(16, 12), (200, 160), 0.07, 0.7)
    g = weights(made.screen)
    found = [on_threads(threads, lambda: made.slopes(backend, g)[0]) for threads in THREADS]
    assert len({tuple(slope.tobytes() for slope in slopes) for slopes in found}) == 1


def test_single_precision_slopes_lose_no_more_than_its_numbers(backend):
    """Weights and slopes are rounded to 6e-8, corners on 1/64 pixels are not."""
    made = smooth(whole(16, 12), (9, 9), 1.1, 0.5)
    made = replace(made, x=np.round(made.x * 64) / 64, y=np.round(made.y * 64) / 64)
    g = weights(made.screen)
    expected, _ = made.slopes(backend, g)
    found, _ = made.slopes(load_backend("single", 1), g)
    for a, b in zip(expected, found):
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-6 * np.abs(a).max())


@pytest.mark.parametrize("counts", [(1, 1), (1, 3)])
def test_no_flux_has_no_slope(backend, counts):
    """Not even by itself: dark cells are left out."""
    made = smooth(SCREEN, counts)
    for dark in (replace(made, passing=np.zeros(made.x.shape)), replace(made, emitted=np.zeros(counts))):
        assert not any(slope.any() for slope in dark.slopes(backend, weights(SCREEN))[0])
