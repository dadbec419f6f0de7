"""The bounds and penalties of the thesis, section 4.4: ranges, derivatives, and what they enforce."""

import numpy as np
import pytest

from examples.thesis import constraints

# |value| < 1 in exact numbers; in doubles tanh and this project's range function reach 1
WIDE = np.concatenate([-np.logspace(9, -3, 60), [0.0], np.logspace(-3, 9, 60)])


@pytest.mark.parametrize("name", constraints.RANGES)
def test_a_range_function_keeps_the_bound_and_rises(name):
    value, slope = constraints.RANGES[name](WIDE)
    assert np.abs(value).max() <= 1
    assert (np.diff(value) >= -4e-16).all()  # rounding near 1
    assert (slope >= 0).all()


@pytest.mark.parametrize("name", constraints.RANGES)
def test_the_slope_of_a_range_function_is_its_derivative(name):
    w, h = np.linspace(-3, 3, 61), 1e-5
    function = constraints.RANGES[name]
    difference = (function(w + h)[0] - function(w - h)[0]) / (2 * h)
    # third derivatives are below 100, so that truncation is below 100 h^2 / 6; rounding is 1e-16 / h
    np.testing.assert_allclose(function(w)[1], difference, rtol=0, atol=3e-9)


def test_only_the_range_function_of_this_project_is_the_identity_inside():
    """w (1 + w^8)^(-1/8) differs from w by w^9 / 8."""
    w = np.linspace(-0.25, 0.25, 11)
    apart = {name: np.abs(function(w)[0] - w).max() for name, function in constraints.RANGES.items()}
    assert apart["this project"] < 0.25**9 / 7.9
    assert min(apart["tanh"], apart["arctan"]) > 1e-3


@pytest.mark.parametrize("name", constraints.PENALTIES)
def test_the_gradient_of_a_penalty_is_its_derivative(name):
    rng, bound, h = np.random.default_rng(3), 0.7, 1e-6
    penalty = constraints.PENALTIES[name]
    c, along = 0.6 * rng.uniform(-1, 1, 36), rng.standard_normal(36)
    difference = (penalty(c + h * along, bound)[0] - penalty(c - h * along, bound)[0]) / (2 * h)
    # rounding of a value of about 100 by the step: 1e-14 / h
    assert penalty(c, bound)[1] @ along == pytest.approx(difference, rel=1e-7, abs=1e-7)


def test_the_smoothness_is_that_of_a_sum_over_neighbours():
    net = np.random.default_rng(4).standard_normal((5, 5))
    total = 0.0
    for i in range(5):
        for j in range(5):
            near = [(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
            total += sum(net[k, m] - net[i, j] for k, m in near if 0 <= k < 5 and 0 <= m < 5) ** 2
    assert constraints.smoothness(net.ravel(), 1.0)[0] == pytest.approx(total, rel=1e-13)
    assert constraints.smoothness(np.full(25, 3.0), 1.0)[0] == 0


def test_outside_a_penalty_of_a_bound_is_infinite():
    c = np.array([0.2, -0.71, 0.1, 0.3])
    assert constraints.barrier(c, 0.7)[0] == np.inf
    assert constraints.entropy(c, 0.7)[0] == np.inf
    assert np.isfinite(constraints.entropy(-c, 0.7)[0])  # it has no bound above
    assert np.isfinite(constraints.barrier(c, 0.72)[0])


def test_a_lens_behind_a_range_function_gets_better_within_the_bound():
    start = constraints.main("tanh", 0.3, iterations=0, rays=(65, 65))
    misfit, greatest = constraints.main("tanh", 0.3, iterations=4, rays=(65, 65))
    assert misfit < start[0]
    assert 0 < greatest <= 1
