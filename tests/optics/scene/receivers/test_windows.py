"""Measurement windows: definition, unit integral, partition of unity, response and filter."""

from itertools import pairwise
from math import ceil, exp

import numpy as np
import pytest
from scipy.signal import convolve2d

from optics.scene.receivers.windows import BoxWindow, BSplineWindow, GaussianWindow, PixelWindow, filter_image
from oracles.light_formulas import window_kinks, window_value

EPS = np.finfo(float).eps
DEGREES = (1, 2, 3, 4, 5)
GAUSSIANS = [
    GaussianWindow(s, c) for s, c in ((1.0, 4.0), (0.3, 4.0), (0.5, 3.0), (1.3, 3.0), (2.5, 4.0), (1.0, 7.0))
]
PIXELS = [PixelWindow(b) for b in (0.05, 0.3, 0.5)]
WINDOWS = [BoxWindow(), *PIXELS, *map(BSplineWindow, DEGREES), *GAUSSIANS]
POINTS = np.r_[0.0, 1e-300, np.linspace(0.01, 0.99, 37), np.nextafter(1.0, 0.0)]


def first_distance(window):
    """Return the distance of a point at t = 0 from the centre of the first tap's pixel."""
    return window.taps // 2 - 1.0 if window.taps % 2 == 0 else window.taps // 2 - 0.5


def tap_distances(window, t):
    """Return the distances of points from the taps' pixel centres, (taps, n)."""
    return first_distance(window) - np.arange(window.taps)[:, None] + t


def tolerance(window):
    """Return how far rounding can move a weight, relative to the greatest one.

    Each tap costs a product per step of the recurrence; an exponential of a carries eps |a|, and
    the farthest exponent is half the squared reach in sigma.
    """
    if isinstance(window, GaussianWindow):
        farthest = (window.taps / 2 / window.sigma) ** 2
        return 4 * EPS * (window.taps + farthest)
    return 4 * EPS * (window.taps + 1)


def gauss(low, high, f, count=30):
    """Return the integral of f by Gauss quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (high - low) / 2 * (weights @ f(low + (high - low) / 2 * (1 + nodes)))


def piecewise(low, high, f, kinks):
    """Return the integral of f, smooth between the kinks."""
    edges = np.unique(np.r_[low, np.clip(kinks, low, high), high])
    return sum(gauss(a, b, f) for a, b in pairwise(edges))


@pytest.mark.parametrize("window", WINDOWS[1:], ids=repr)
def test_weights_follow_the_definition(window):
    weights = np.stack(window.weights(POINTS, np.exp))
    expected = window_value(window, tap_distances(window, POINTS))
    np.testing.assert_allclose(weights, expected, rtol=0, atol=tolerance(window) * expected.max())


@pytest.mark.parametrize("window", WINDOWS, ids=repr)
def test_there_are_as_many_weights_as_taps_and_none_is_negative(window):
    weights = [w + 0 * POINTS for w in window.weights(POINTS, np.exp)]
    assert len(weights) == window.taps
    assert np.min(weights) >= -tolerance(window)


PARTITIONS = [*PIXELS, *map(BSplineWindow, DEGREES)]


@pytest.mark.parametrize("window", PARTITIONS, ids=repr)
def test_weights_sum_to_one_over_the_pixels(window):
    np.testing.assert_allclose(sum(window.weights(POINTS)), 1.0, rtol=0, atol=(window.taps + 1) * EPS)


@pytest.mark.parametrize("window", PARTITIONS, ids=repr)
def test_weights_go_on_smoothly_across_a_pixel(window):
    """At t = 1 each tap is what the one before it was at t = 0: the window has no jump."""
    start, end = window.weights(np.array([0.0])), window.weights(np.array([1.0]))
    np.testing.assert_allclose(
        [w[0] for w in end[1:]], [w[0] for w in start[:-1]], rtol=0, atol=(window.taps + 1) * EPS
    )
    assert end[0][0] == pytest.approx(0.0, abs=EPS)


@pytest.mark.parametrize("window", PIXELS, ids=repr)
def test_pixel_window_has_no_kink(window):
    """Second differences across the ends of the blurred border shrink faster than the step: the slope is
    continuous."""
    for end in (0.5 - window.blur, 0.5 + window.blur):
        slopes = []
        for step in (1e-3, 1e-4):
            low, middle, high = (
                window.weights(np.array([end + k * step * window.blur]))[1][0] for k in (-1, 0, 1)
            )
            slopes.append(abs(high - 2 * middle + low) / step)
        assert slopes[1] <= 0.2 * slopes[0] + 1e-9


@pytest.mark.parametrize("window", WINDOWS[1:], ids=repr)
def test_windows_have_unit_integral(window):
    """Taps are pieces of one window: their integrals over t add up to the integral of W."""
    total = 0.0
    for tap in range(window.taps):
        kinks = window_kinks(window) - first_distance(window) + tap
        total += piecewise(0.0, 1.0, lambda t, r=tap: window.weights(t, np.exp)[r], kinks)
    assert total == pytest.approx(1.0, abs=tolerance(window))


@pytest.mark.parametrize("window", GAUSSIANS, ids=repr)
def test_gaussian_window_is_zero_at_its_cut_and_beyond(window):
    reach = window.cut * window.sigma
    t = np.r_[np.mod(reach, 1.0), np.mod(-reach, 1.0), POINTS]
    distance = tap_distances(window, t)
    weights = np.stack(window.weights(t, np.exp))
    at_cut = np.isclose(np.abs(distance), reach, rtol=0, atol=4 * EPS * reach)
    assert at_cut.any()
    slope = (
        reach / window.sigma**2 * exp(-0.5 * window.cut**2)
    )  # of the Gaussian at the cut, where rounding moves the point
    assert np.abs(weights[at_cut]).max() <= tolerance(window) * (1 + slope)
    beyond = np.abs(distance) > reach * (1 + 4 * EPS)
    assert (np.abs(weights[beyond]) <= tolerance(window) * exp(-0.5 * window.cut**2)).all()


@pytest.mark.parametrize("window", WINDOWS, ids=repr)
def test_response_is_the_integral_of_the_window_over_pixels(window):
    response = window.response()
    reach = len(response) // 2
    assert len(response) == 2 * reach + 1
    centres = np.arange(-reach, reach + 1)
    expected = [
        piecewise(c - 0.5, c + 0.5, lambda d: window_value(window, d), window_kinks(window)) for c in centres
    ]
    np.testing.assert_allclose(response, expected, rtol=0, atol=tolerance(window))
    assert reach >= ceil(window_kinks(window)[-1] - 0.5)


@pytest.mark.parametrize("window", WINDOWS, ids=repr)
def test_response_sums_to_one_and_is_symmetric(window):
    response = window.response()
    assert response.sum() == pytest.approx(1.0, abs=tolerance(window))
    np.testing.assert_allclose(response, response[::-1], rtol=0, atol=tolerance(window))


@pytest.mark.parametrize("window", WINDOWS, ids=repr)
def test_filter_is_the_convolution_with_the_response(window):
    image = np.random.default_rng(1).uniform(0, 1, (29, 41))
    expected = convolve2d(image, np.outer(window.response(), window.response()), mode="full")
    reach = len(window.response()) // 2
    expected = expected[reach : reach + 29, reach : reach + 41]
    np.testing.assert_allclose(
        filter_image(image, window), expected, rtol=0, atol=100 * EPS * len(window.response())
    )


@pytest.mark.parametrize("window", WINDOWS, ids=repr)
def test_filter_keeps_the_flux_away_from_the_borders(window):
    reach = len(window.response()) // 2
    image = np.pad(np.random.default_rng(2).uniform(0, 1, (12, 17)), reach)
    assert filter_image(image, window).sum() == pytest.approx(image.sum(), rel=2 * tolerance(window))


def test_light_outside_the_picture_is_dark():
    """A pixel in the corner keeps only the share of the window that lies inside."""
    response = BSplineWindow(3).response()
    corner = filter_image(np.pad([[1.0]], ((0, 5), (0, 5))), BSplineWindow(3))
    assert corner.sum() == pytest.approx(response[2:].sum() ** 2, rel=1e-14)
