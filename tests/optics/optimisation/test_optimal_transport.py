"""Optimal transport between rectangles: exact cases, convergence, and conservation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import erf

from optics.optimisation.optimal_transport import transport
from optics.sources import Profile


def by_cells(cdf_x, cdf_y):
    """Return density(grid), the exact cell means of a product density with these integrals over [-1, 1]."""

    def density(grid):
        ends = [np.linspace(-1, 1, n + 1) for n in grid]
        return np.outer(*(np.diff(cdf(e)) * n for cdf, e, n in zip((cdf_x, cdf_y), ends, grid)))

    return density


def blob(grid):
    """Return a density without symmetry, at cell centres."""
    x, y = ((2 * np.arange(n) + 1) / n - 1 for n in grid)
    return 0.2 + np.exp(-((x[:, None] - 0.3) ** 2 + (y[None, :] + 0.4) ** 2) / 0.1)


@pytest.mark.parametrize("aspect", [1.0, 0.4, 2.5])
@pytest.mark.parametrize("level", [1.0, 1e-6, 1e6])
def test_uniform_light_needs_no_transport(aspect, level):
    found = transport(lambda grid: np.full(grid, level), (48, 64), aspect)
    np.testing.assert_allclose(found.tx, np.repeat(found.x[:, None], 64, axis=1), rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.ty, np.repeat(found.y[None, :], 48, axis=0), rtol=0, atol=1e-14)
    assert found.residual < 1e-14


@pytest.mark.parametrize("aspect", [1.0, 1.7])
def test_product_densities_are_met_axis_by_axis_with_order_two(aspect):
    """Densities 1 + cos(pi x) / 2 and 1 - 0.6 cos(pi y): the map is the inverse of each integral."""

    def cdf_x(t):
        return t + 0.5 * np.sin(np.pi * t) / np.pi

    def cdf_y(t):
        return t - 0.6 * np.sin(np.pi * t) / np.pi

    errors = []
    for n in (32, 64, 128):
        found = transport(by_cells(cdf_x, cdf_y), (n, n), aspect)
        x, y = (
            [brentq(lambda t, s=s, f=f: f(t) - s, -1, 1, xtol=1e-14) for s in row]
            for row, f in ((found.x, cdf_x), (found.y, cdf_y))
        )
        errors.append(
            max(np.abs(found.tx - np.array(x)[:, None]).max(), np.abs(found.ty - np.array(y)[None, :]).max())
        )
    assert errors[-1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)


def test_the_map_carries_uniform_light_to_the_density():
    """Source cells counted in 8 x 8 boxes of the target; finer cells miscount less (only those on the boxes'
    borders)."""
    wanted = blob((256, 256)).reshape(8, 32, 8, 32).sum(axis=(1, 3))
    wanted /= wanted.sum()
    errors = []
    for n in (64, 256):
        found = transport(blob, (n, n), 1.0)
        counted = np.histogram2d(found.tx.ravel(), found.ty.ravel(), bins=8, range=[[-1, 1]] * 2)[0] / n**2
        errors.append(np.abs(counted - wanted).sum())
    # 32 border lines of n cells, each wrong by half a cell's share at random: below 16 / n
    assert errors[0] < 16 / 64
    assert errors[1] < errors[0] / 3


def test_rays_do_not_cross():
    """The gradient of a convex function is monotone in both directions and keeps to the target."""
    found = transport(blob, (96, 80), 1.2)
    assert (np.diff(found.tx, axis=0) > 0).all()
    assert (np.diff(found.ty, axis=1) > 0).all()
    assert max(np.abs(found.tx).max(), np.abs(found.ty).max()) <= 1
    assert found.residual < 0.01


def test_darkness_is_carried_over_a_floor():
    """A picture that is black in one half sends next to nothing there, and the map stays finite."""
    found = transport(
        lambda grid: np.repeat((np.arange(grid[0]) >= grid[0] / 2)[:, None].astype(float), grid[1], axis=1),
        (64, 64),
        1.0,
    )
    assert np.isfinite(found.tx).all()
    assert (found.tx < -0.1).mean() < 0.05


def test_high_contrast_is_followed_to_the_lowest_floor():
    """A bright ring on a ground that is 50 times darker: the map solves the equation to a tenth and does not
    fold."""

    def ring(grid):
        x, y = ((2 * np.arange(n) + 1) / n - 1 for n in grid)
        return 0.02 + np.exp(-(((np.hypot(x[:, None], y[None, :]) - 0.6) / 0.1) ** 2))

    found = transport(ring, (96, 96), 1.0)
    assert found.floor == 0.02
    assert found.residual < 0.1
    assert (np.diff(found.tx, axis=0) > 0).all()
    assert (np.diff(found.ty, axis=1) > 0).all()


@pytest.mark.parametrize("shape", [(64, 64), (65, 33), (2, 40), (3, 3)])
def test_any_grid_gives_finite_positions_inside_the_target(shape):
    found = transport(blob, shape, 1.0)
    assert found.tx.shape == found.ty.shape == shape
    assert np.isfinite(found.tx).all()
    assert np.isfinite(found.ty).all()
    assert max(np.abs(found.tx).max(), np.abs(found.ty).max()) <= 1


@pytest.mark.parametrize("sigma", [0.5, 0.8])
def test_a_gaussian_beam_spreads_evenly_by_the_error_function(sigma):
    """A separable source onto uniform light: t = erf(x / (sigma sqrt 2)) / erf(1 / (sigma sqrt 2)) in each
    direction."""
    profile = Profile("gaussian", (sigma, sigma))

    def source(grid):
        s, t = ((2 * np.arange(n) + 1) / n - 1 for n in grid)
        return profile(s[:, None], t[None, :])

    found = transport(np.ones, (128, 128), 1.0, source)
    wanted = erf(found.x / (sigma * np.sqrt(2))) / erf(1 / (sigma * np.sqrt(2)))
    assert abs(found.tx - wanted[:, None]).max() < 0.02
    assert abs(found.ty - wanted[None, :]).max() < 0.02
    assert found.residual < 0.1
