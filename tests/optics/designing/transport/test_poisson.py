"""Potentials from sources and heights from slopes: exact cases, order, and invariants."""

import numpy as np
import pytest

from optics.designing.transport import height_from_slopes
from optics.designing.transport.poisson import solved_poisson


def centres(n, half):
    return half * ((2 * np.arange(n) + 1) / n - 1)


def test_the_potential_solves_the_five_point_equation():
    density = np.random.default_rng(3).normal(size=(14, 9))
    hx, hy = 0.5, 0.2
    u = np.pad(solved_poisson(density, (hx, hy)), 1, mode="edge")
    laplacian = (u[2:, 1:-1] - 2 * u[1:-1, 1:-1] + u[:-2, 1:-1]) / hx**2
    laplacian += (u[1:-1, 2:] - 2 * u[1:-1, 1:-1] + u[1:-1, :-2]) / hy**2
    np.testing.assert_allclose(-laplacian, density - density.mean(), rtol=0, atol=1e-12)
    assert u[1:-1, 1:-1].mean() == pytest.approx(0, abs=1e-14)


def test_slopes_of_a_quadratic_give_it_back():
    """The mean of two linear slopes is the quotient of differences; only rounding is left."""
    x, y = centres(24, 3.0)[:, None], centres(17, 5.0)[None, :]
    z = 0.3 * x**2 - 0.2 * x * y + 0.1 * y**2 + x - 2 * y
    found = height_from_slopes(0.6 * x - 0.2 * y + 1, -0.2 * x + 0.2 * y - 2, (0.25, 10 / 17))
    np.testing.assert_allclose(found, z - z.mean(), rtol=0, atol=1e-12)


def test_the_height_of_a_smooth_surface_is_met_with_order_two():
    errors = []
    for n in (16, 32, 64, 128):
        x, y = centres(n, 1.0)[:, None], centres(2 * n, 2.0)[None, :]
        z = np.exp(x) * np.sin(y + 0.3)
        found = height_from_slopes(z, np.exp(x) * np.cos(y + 0.3), (2 / n, 2 / n))
        errors.append(np.abs(found - (z - z.mean())).max())
    assert errors[-1] < 1e-4
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4, rtol=0.1)


@pytest.mark.parametrize("axis", [0, 1])
def test_heights_turn_with_their_slopes_even_where_these_are_no_gradient(axis):
    """No direction and no row is preferred: mirrored and exchanged slopes give the mirrored height."""
    zx, zy = np.random.default_rng(4).normal(size=(2, 20, 20))
    height = height_from_slopes(zx, zy, (0.1, 0.1))
    mirrored = [np.flip(a, axis) for a in (zx, zy)]
    mirrored[axis] = -mirrored[axis]
    np.testing.assert_allclose(
        height_from_slopes(*mirrored, (0.1, 0.1)), np.flip(height, axis), rtol=0, atol=1e-13
    )
    np.testing.assert_allclose(height_from_slopes(zy.T, zx.T, (0.1, 0.1)), height.T, rtol=0, atol=1e-13)


def test_a_crack_moves_the_height_beside_it_only_as_much_as_least_squares_ask():
    """One wrong slope in n^2 changes the height far away by less than its own step, along its row too."""
    n = 64
    zx, zy = np.zeros((2, n, n))
    zx[n // 2, n // 2] = 1.0
    height = height_from_slopes(zx, zy, (1.0, 1.0))
    assert abs(height[-1, n // 2] - height[0, n // 2]) < 0.05
