"""The optimiser's variables: where they start, that they keep the bounds, and their adjoint."""

from __future__ import annotations

import numpy as np
import pytest

from optics.variables import BoundedVariables
from tests.optics.small import rough, small_space
from thbcad.thb import THBSurface

BOUND = 0.7


def variables(height=0.3):
    space = small_space()
    sag = THBSurface(space, rough(space, height))
    return BoundedVariables(sag, BOUND), sag


@pytest.mark.parametrize("height", [0.0, 0.3, 0.98 * BOUND])
def test_zero_weights_are_the_start(height):
    found, sag = variables(height)
    # at 0.98 of the bound the squashing is steep: its inverse has slope 1 / (1 - 0.98^8) = 7
    np.testing.assert_allclose(found.coefficients(found.zeros()), sag.coefficients, rtol=0, atol=1e-15 * BOUND * 10)


@pytest.mark.parametrize("outside", [BOUND, 1.5 * BOUND])
def test_a_start_on_the_bound_is_moved_inside(outside):
    space = small_space()
    found = BoundedVariables(THBSurface(space, np.full(space.dim, -outside)), BOUND)
    c = found.coefficients(found.zeros())
    assert (c > -BOUND).all()
    np.testing.assert_allclose(c, -BOUND, rtol=0.011)


@pytest.mark.parametrize("size", [1.0, 1e2, 1e4, 1e8])
def test_coefficients_never_pass_the_bound(size):
    found, _ = variables()
    rng = np.random.default_rng(1)
    for _ in range(20):
        c = found.coefficients(rng.standard_normal(len(found.zeros())) * size)
        assert np.isfinite(c).all()
        assert np.abs(c).max() <= BOUND * (1 + 1e-15)  # rounding of the last product


@pytest.mark.parametrize("size", [0.0, 1.0, 30.0])
def test_the_gradient_is_that_of_the_map(size):
    """Central differences of g . c(w) with h = 1e-4: the squashing is smooth, h^2 c''' is below 1e-8 of the slope."""
    found, _ = variables()
    rng = np.random.default_rng(2)
    at, direction = (rng.standard_normal(len(found.zeros())) for _ in range(2))
    at *= size
    g = rng.standard_normal(len(found.coefficients(at)))
    gradient = found.gradient(g)
    h = 1e-4
    difference = (g @ found.coefficients(at + h * direction) - g @ found.coefficients(at - h * direction)) / (2 * h)
    scale = np.linalg.norm(gradient) * np.linalg.norm(direction)
    assert gradient @ direction == pytest.approx(difference, abs=1e-7 * scale)
