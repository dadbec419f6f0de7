"""Height errors: jets against scipy and against differences, and sentences for bad input."""

import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from optics.base.runtime import UserError
from optics.tolerancing.perturbations import HeightSum, Power, Sine, SplineHeight

HALF = (30.0, 20.0)
GENERATOR = np.random.default_rng(5)
X, Y = (GENERATOR.uniform(-h, h, 40_000) for h in HALF)
NET = GENERATOR.normal(size=(23, 17))


def test_the_jet_of_a_spline_is_that_of_scipy():
    jet = SplineHeight(NET, HALF).jet(X, Y)
    knots = tuple(h * (2 * np.arange(-3, n + 1) / (n - 3) - 1) for h, n in zip(HALF, NET.shape))
    peer = NdBSpline(knots, NET, 3)
    points = np.column_stack([X, Y])
    for row, order in zip(jet, ((0, 0), (1, 0), (0, 1))):
        np.testing.assert_allclose(row, peer(points, nu=order), rtol=0, atol=1e-13 * abs(NET).max())


def test_beside_its_rectangle_a_spline_is_what_it_is_on_the_rim():
    error = SplineHeight(NET, HALF)
    one = np.ones(1)
    np.testing.assert_array_equal(error.jet(31 * one, -21 * one), error.jet(30 * one, -20 * one))


@pytest.mark.parametrize(
    "error",
    [
        Sine(2e-4, 7.0, 33.0, 0.4),
        Power(-3e-6),
        HeightSum(((-0.3, Sine(1e-3, 5.0)),)),
        HeightSum(((1.0, Power(1e-6)), (2.0, Sine(1e-4, 3.0)))),
    ],
    ids=lambda e: type(e).__name__,
)
def test_derivatives_are_those_of_the_height(error):
    step = 1e-4
    _, by_x, by_y = error.jet(X[:50], Y[:50])
    for slope, (dx, dy) in ((by_x, (step, 0)), (by_y, (0, step))):
        up, down = (error.jet(X[:50] + s * dx, Y[:50] + s * dy)[0] for s in (1, -1))
        np.testing.assert_allclose(slope, (up - down) / (2 * step), rtol=1e-6, atol=1e-11)


def test_a_sum_of_nothing_is_zero():
    np.testing.assert_array_equal(HeightSum(()).jet(X[:3], Y[:3]), np.zeros((3, 3)))


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Sine(np.nan, 3.0), "amplitude must be a finite number"),
        (lambda: Sine(1e-4, 0.0), "period must be a positive finite number"),
        (lambda: Power(np.inf), "curvature must be a finite number"),
        (lambda: HeightSum(((np.nan, Power(1.0)),)), "factor must be a finite number"),
        (lambda: SplineHeight(np.zeros((3, 9)), HALF), "at least 4 x 4 control points, got .3, 9."),
        (lambda: SplineHeight(np.full((5, 9), np.nan), HALF), "must be finite"),
        (lambda: SplineHeight(NET, (1.0, 0.0)), "half_width must be two positive numbers"),
        (lambda: SplineHeight("net", HALF), "must be numbers"),
    ],
)
def test_bad_numbers_are_refused_in_a_sentence(make, sentence):
    with pytest.raises(UserError, match=sentence):
        make()
