"""Optimal transport between rectangles: exact cases, convergence, conservation, and darkness."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import savgol_filter
from scipy.special import erf

from optics.base.runtime import load_backend
from optics.designing.transport import back_and_forth, transport_map
from optics.designing.transport.back_and_forth import _gradient
from optics.scene.sources import Profile
from tests.cases import slow_unless


def by_cells(cdf_x, cdf_y):
    """Return density(grid), the exact cell means of a product density with these integrals over [-1, 1]."""

    def density(grid):
        ends = [np.linspace(-1, 1, n + 1) for n in grid]
        return np.outer(*(np.diff(cdf(e)) * n for cdf, e, n in zip((cdf_x, cdf_y), ends, grid)))

    return density


def gaussian(sigma, middle):
    """Return the cell means of a product of Gaussians."""
    return by_cells(
        *(lambda t, s=s, m=m: erf((t - m) / (s * np.sqrt(2))) for s, m in zip(sigma, middle, strict=True))
    )


def box(x0, x1, y0, y1):
    """Return the cell means of uniform light on a rectangle in the dark."""
    return by_cells(lambda t: np.clip(t, x0, x1), lambda t: np.clip(t, y0, y1))


def block_means(picture, grid):
    """Return the means of a picture over the cells of a coarser grid."""
    (n, m), (i, j) = picture.shape, grid
    return picture.reshape(i, n // i, j, m // j).mean(axis=(1, 3))


def centres(grid):
    x, y = ((2 * np.arange(n) + 1) / n - 1 for n in grid)
    return x[:, None], y[None, :]


def blob(grid):
    """Return a density without symmetry, at cell centres."""
    x, y = centres(grid)
    return 0.2 + np.exp(-((x - 0.3) ** 2 + (y + 0.4) ** 2) / 0.1)


def islands(grid):
    """Return two bright disks in the dark, one twice as bright as the other."""
    x, y = centres(grid)
    return (np.hypot(x - 0.5, y - 0.5) < 0.2) + 2.0 * (np.hypot(x + 0.5, y + 0.3) < 0.15)


def largest_error(found, tx, ty):
    return max(np.abs(a - b).max() for a, b in zip(found, (tx, ty), strict=True))


@pytest.mark.parametrize("aspect", [1.0, 0.4, 2.5])
@pytest.mark.parametrize("level", [1.0, 1e-6, 1e6])
def test_uniform_light_needs_no_transport(backend, aspect, level):
    """Up to rounding, 1e-16 of the light, which 40 steps of sigma = 32 add up on 64^2 cells."""
    found = transport_map(backend, lambda grid: np.full(grid, level), (48, 64), aspect).places
    assert largest_error(found, *centres((48, 64))) < 1e-16 * 40 * 32 * 64**2


@pytest.mark.every(2)
@pytest.mark.parametrize("aspect", [1.0, 1.7])
def test_product_densities_are_met_axis_by_axis_with_order_two(backend, aspect):
    """Densities 1 + cos(pi x) / 2 and 1 - 0.6 cos(pi y): the map is the inverse of each integral.

    In root mean squares: at the border the smoothing is of the first order.
    """

    def cdf_x(t):
        return t + 0.5 * np.sin(np.pi * t) / np.pi

    def cdf_y(t):
        return t - 0.6 * np.sin(np.pi * t) / np.pi

    errors, sizes = [], (32, 64, 128, 256)
    for n in sizes:
        tx, ty = transport_map(backend, by_cells(cdf_x, cdf_y), (n, n), aspect).places
        x, y = (
            np.array([brentq(lambda t, s=s, f=f: f(t) - s, -1, 1, xtol=1e-14) for s in row])
            for row, f in zip(map(np.ravel, centres((n, n))), (cdf_x, cdf_y))
        )
        errors.append(np.sqrt(np.mean((tx - x[:, None]) ** 2 + (ty - y) ** 2)))
    assert errors[-1] < 2e-4
    assert -np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 1.8


@pytest.mark.parametrize("n", slow_unless((128).__eq__, [128, 256]))
def test_between_gaussians_the_map_is_affine(backend, n):
    """Also from a wide one to a narrow one beside it, and back; within two standard deviations, to a cell."""
    wide, narrow = ((0.2, 0.15), (0.0, 0.0)), ((0.1, 0.2), (0.3, -0.2))
    for (s0, m0), (s1, m1) in ((wide, narrow), (narrow, wide)):
        found = transport_map(backend, gaussian(s1, m1), (n, n), 1.0, gaussian(s0, m0)).places
        x, y = centres((n, n))
        near = (abs(x - m0[0]) < 2 * s0[0]) & (abs(y - m0[1]) < 2 * s0[1])
        tx, ty = m1[0] + (x - m0[0]) * s1[0] / s0[0], m1[1] + (y - m0[1]) * s1[1] / s0[1]
        for place, wanted in zip(found, (tx, ty), strict=True):
            assert np.abs(place - wanted)[near].max() < 2.5 / n


@pytest.mark.parametrize("n", slow_unless((128).__eq__, [128, 256]))
def test_a_rectangle_in_the_dark_is_filled_by_an_affine_map(backend, n):
    """To a cell, 2 / n."""
    found = transport_map(backend, box(-0.5, 0.25, -0.75, 0.5), (n, n), 1.0).places
    x, y = centres((n, n))
    assert largest_error(found, -0.125 + 0.375 * x, -0.125 + 0.625 * y) < 2 / n


def test_light_that_comes_from_a_rectangle_in_the_dark_is_spread_by_an_affine_map(backend):
    """Where there is no light, the map is without meaning, but finite and inside the target."""
    tx, ty = transport_map(backend, np.ones, (128, 128), 1.0, box(-0.5, 0.25, -0.75, 0.5)).places
    x, y = centres((128, 128))
    lit = (x > -0.5) & (x < 0.25) & (y > -0.75) & (y < 0.5)
    assert np.abs(tx - (x + 0.125) / 0.375)[lit].max() < 2 * 2 / 128
    assert np.abs(ty - (y + 0.125) / 0.625)[lit].max() < 2 * 2 / 128
    assert np.abs((tx, ty)).max() <= 1


def test_the_map_carries_uniform_light_to_the_density(backend):
    """Source cells counted in 8 x 8 boxes of the target; finer cells miscount less (only those on the boxes'
    borders)."""
    wanted = blob((256, 256)).reshape(8, 32, 8, 32).sum(axis=(1, 3))
    wanted /= wanted.sum()
    errors = []
    for n in (64, 256):
        tx, ty = transport_map(backend, blob, (n, n), 1.0).places
        counted = np.histogram2d(tx.ravel(), ty.ravel(), bins=8, range=[[-1, 1]] * 2)[0] / n**2
        errors.append(np.abs(counted - wanted).sum())
    # 32 border lines of n cells, each wrong by half a cell's share at random: below 16 / n
    assert errors[0] < 16 / 64
    assert errors[1] < errors[0] / 3


@pytest.mark.parametrize("density", [blob, islands])
def test_rays_do_not_cross(backend, density):
    """The gradient of a convex function is monotone in both directions and keeps to the target.

    Inside it is a sum of such gradients; lines and parabolas at the border hold it to a cell.
    """
    tx, ty = transport_map(backend, density, (96, 80), 1.2).places
    for steps, cell in ((np.diff(tx, axis=0), 2 / 96), (np.diff(ty, axis=1).T, 2 / 80)):
        assert (steps[2:-2, 1:-1] > -1e-12).all()
        assert (steps > -cell).all()
    assert np.abs((tx, ty)).max() <= 1


def test_bright_islands_in_the_dark_are_fed_and_the_dark_is_not(backend):
    """Each island gets its share; only cells that the crack between the islands runs through land beside.

    Those are two cells wide along a line of n: below 4 / n in all, and half of it for each island.
    """
    n = 256
    tx, ty = transport_map(backend, islands, (n, n), 1.0).places
    first = (np.hypot(tx - 0.5, ty - 0.5) < 0.2 + 2 / n).mean()
    second = (np.hypot(tx + 0.5, ty + 0.3) < 0.15 + 2 / n).mean()
    wanted = 0.2**2 / (0.2**2 + 2 * 0.15**2)
    assert 1 - first - second < 4 / n * 2
    assert first == pytest.approx(wanted, abs=4 / n)
    assert second == pytest.approx(1 - wanted, abs=4 / n)


def test_a_disk_on_black_gets_all_light(backend):
    """By symmetry the map keeps both diagonals and both axes; no cell lands farther than one outside."""
    n = 128
    tx, ty = transport_map(
        backend, lambda grid: np.where(np.hypot(*centres(grid)) < 0.6, 1.0, 0.0), (n, n), 1.0
    ).places
    assert np.hypot(tx, ty).max() < 0.6 + 2 * 2 / n
    np.testing.assert_allclose(tx, -tx[::-1], rtol=0, atol=1e-10)
    np.testing.assert_allclose(tx, tx[:, ::-1], rtol=0, atol=1e-10)
    np.testing.assert_allclose(tx, ty.T, rtol=0, atol=1e-10)


def test_half_of_the_target_in_the_dark_gets_nothing(backend):
    """The map is (x + 1) / 2 exactly."""
    found = transport_map(backend, box(0.0, 1.0, -1.0, 1.0), (64, 64), 1.0).places
    x, y = centres((64, 64))
    assert largest_error(found, (x + 1) / 2, y) < 2 / 64


@pytest.mark.parametrize("shape", [(64, 64), (65, 33), (5, 40), (130, 7)])
def test_any_grid_gives_finite_positions_inside_the_target(backend, shape):
    tx, ty = transport_map(backend, blob, shape, 1.0).places
    assert tx.shape == ty.shape == shape
    assert np.isfinite((tx, ty)).all()
    assert np.abs((tx, ty)).max() <= 1


def test_steps_end_where_the_dual_value_stands_still(backend, monkeypatch):
    """Uniform light needs no transport: of two steps of both potentials the second changes nothing."""
    taken = []
    carried = back_and_forth.push_forward
    monkeypatch.setattr(back_and_forth, "push_forward", lambda *of: taken.append(1) or carried(*of))
    transport_map(backend, np.ones, (80, 80), 1.0)
    assert len(taken) == 4


def test_few_steps_are_tried_where_cells_limit_the_gain(backend, monkeypatch):
    """Of a texture; if sigma only fell by a fifth wherever less is found than promised it would be 92."""
    taken = []
    carried = back_and_forth.push_forward
    monkeypatch.setattr(back_and_forth, "push_forward", lambda *of: taken.append(1) or carried(*of))
    texture = np.random.default_rng(0).uniform(0.2, 1.0, (256, 256))
    transport_map(backend, lambda grid: block_means(texture, grid), (256, 256), 1.0)
    assert len(taken) <= 40


@pytest.mark.parametrize("sigma", [0.5, 0.8])
def test_a_gaussian_beam_spreads_evenly_by_the_error_function(backend, sigma):
    """A separable source onto uniform light: t = erf(x / (sigma sqrt 2)) / erf(1 / (sigma sqrt 2)) in each
    direction."""
    profile = Profile("gaussian", (sigma, sigma))
    found = transport_map(backend, np.ones, (128, 128), 1.0, lambda grid: profile(*centres(grid))).places
    wanted = [erf(a / (sigma * np.sqrt(2))) / erf(1 / (sigma * np.sqrt(2))) for a in centres((128, 128))]
    assert largest_error(found, *wanted) < 2 / 128


def test_single_precision_of_the_run_does_not_change_the_map(backend):
    single = transport_map(load_backend("single", 1), islands, (64, 64), 1.0).places
    double = transport_map(backend, islands, (64, 64), 1.0).places
    np.testing.assert_array_equal(single[0], double[0])


@pytest.mark.parametrize("shape", [(5, 9), (40, 31)])
def test_slopes_of_potentials_are_those_of_fitted_parabolas(shape):
    """Against scipy's filter of Savitzky and Golay, at the border too."""
    psi, spacing = np.random.default_rng(2).standard_normal(shape), (0.3, 0.7)
    for axis, found in enumerate(_gradient(psi, spacing)):
        slope = savgol_filter(psi, 5, 2, deriv=1, delta=spacing[axis], axis=axis)
        np.testing.assert_allclose(found, savgol_filter(slope, 3, 1, axis=1 - axis), rtol=0, atol=1e-13)
