"""The arithmetic of `thbcad bench error` and `thbcad bench scaling`."""

from fractions import Fraction

import numpy as np
import pytest

from optics.scene.problem import load_problem
from optics.scene.system import System
from oracles.error_measures import Point, exponent, observed_order, seconds_at, slope_of_fit, worst_difference
from oracles.ray_samplings import grid_points, jittered_points, random_points, sampled_rays, sobol_points
from tests.cases import ROOT

ALL = [random_points, jittered_points, grid_points, sobol_points]


def points(*pairs):
    """Return points with the given seconds and errors."""
    return [
        Point("case", "method", k, seconds, error, np.nan, np.nan, np.nan)
        for k, (seconds, error) in enumerate(pairs)
    ]


@pytest.mark.parametrize("order", [0.5, 1.0, 1.75])
def test_a_power_law_shows_its_order(order):
    rays = [1 << k for k in (10, 12, 14)]
    errors = [3 * n**-order for n in rays]
    assert observed_order(rays, errors, 0) == pytest.approx(order, rel=1e-12)
    assert exponent(rays, errors) == pytest.approx(-order, rel=1e-12)
    # a floor below which errors do not count leaves two points, then one
    assert observed_order([*rays, 1 << 16], [*errors, errors[-1]], 1.01 * errors[-1]) == pytest.approx(
        order, rel=1e-12
    )
    assert np.isnan(observed_order(rays, errors, 1.01 * errors[1]))


def test_the_time_of_an_error_lies_on_the_line_between_two_points():
    curve = points((0.01, 1e-1), (0.1, 1e-2), (1.0, 1e-4))
    assert seconds_at(curve, 1e-2) == pytest.approx(0.1, rel=1e-12)
    assert seconds_at(curve, 1e-3) == pytest.approx(10**-0.5, rel=1e-12)
    assert seconds_at(curve, 0.5) == 0.01
    assert seconds_at(curve, 1e-5) == np.inf


@pytest.mark.parametrize("dimension", [2, 4])
def test_every_cell_holds_one_jittered_and_one_grid_point(dimension):
    side = 4
    for sample in (jittered_points, grid_points):
        drawn = sample(np.random.default_rng(0), side**dimension, dimension)
        cells = np.floor(drawn * side).astype(int)
        assert drawn.shape == (side**dimension, dimension)
        assert len(np.unique(cells, axis=0)) == side**dimension
    middles = {Fraction(2 * k + 1, 2 * side) for k in range(side)}
    assert {Fraction(float(v)) for v in drawn.ravel()} == middles


@pytest.mark.parametrize("sample", ALL)
@pytest.mark.parametrize("example", ["pearl", "extended"])
def test_rays_fill_the_source_and_carry_its_flux(sample, example):
    """The mean of u^2 over [-1, 1] is 1/3; of 4096 independent points it deviates by (4/45 / 4096)^(1/2) =
    0.0047; 5 of these."""
    problem = load_problem(ROOT / "examples" / f"{example}.toml")
    rays = sampled_rays(problem.source, System(problem).base, sample, 4096)
    assert rays.total == pytest.approx(problem.source.flux, rel=1e-12)
    for row, half in zip(rays.origin, problem.source.half_width):
        assert np.abs(row).max() < half
        # a grid of m = 8 points falls short of 1/3 by 1 / (3 m^2)
        assert np.mean((row / half) ** 2) == pytest.approx(1 / 3, abs=0.024)
    np.testing.assert_allclose(np.linalg.norm(rays.direction, axis=0), 1, rtol=1e-14)
    spread = np.mean(rays.direction[:2] ** 2, axis=1)
    # over the unit disk the mean of p^2 is 1/4, its deviation (1/16 / 4096)^(1/2) = 0.004
    np.testing.assert_allclose(spread, 0.25 if example == "extended" else 0.0, atol=0.02)


def test_slope_of_fit_is_the_derivative():
    """The fit is a quadratic, so that a central difference errs by rounding alone, 1e-16 / 1e-3."""
    rng = np.random.default_rng(4)
    image, target, way = rng.random((3, 5, 4))

    def fit(e):
        return np.square(e - target).sum() / np.square(target).sum()

    slope = (fit(image + 1e-3 * way) - fit(image - 1e-3 * way)) / 2e-3
    assert np.vdot(slope_of_fit(image, target), way) == pytest.approx(slope, rel=1e-11)


def test_differences_find_a_true_gradient_and_a_false_one():
    """Fourth-order differences are exact for quartics but for rounding, 1e-16 L / h = 1e-10 of a gradient of
    the loss's size."""
    at = np.linspace(1, 2, 7)

    def loss(c):
        return np.sum(c**4)

    assert worst_difference(loss, at, 4 * at**3, 1e-4) < 1e-11
    assert worst_difference(loss, at, 4 * at**3 * (1 + 1e-6), 1e-4) > 1e-7
    assert 1e-9 < worst_difference(loss, at, 4 * at**3, 1e-4, smooth=False) < 1e-6
