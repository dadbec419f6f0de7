"""Analytic responses of equal sources, checked by convolution, by transform and by the solver."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose

from examples.thesis.chapter7.analytic import RectangleResponse, source_transform
from optics.designing.etendue import approximate

ROUNDING = 1e-12

responses = st.builds(
    RectangleResponse, st.sampled_from([0.5, 1.0, 3.0]), st.integers(1, 7), st.integers(0, 4)
)


@given(responses, st.integers(1, 5))
def test_the_convolution_is_a_rectangle(response, pixels):
    kernel, light = response.on_pixels(pixels)
    made = np.trim_zeros(np.convolve(light[0], kernel.weights[0]))
    assert len(made) == pixels * response.sources * 2**response.splits
    assert_allclose(made, 1, rtol=ROUNDING)


@given(responses)
def test_shifted_copies_fill_the_rectangle_once(response):
    """At places between the edges of all pieces, N responses of height N, each at 1 / N, add up to the
    rectangle."""
    pieces = response.sources * 2**response.splits
    x = (np.arange(-pieces, 2 * pieces) + 0.5) * response.spacing - response.width / 2
    made = np.mean([response(x - position) for position in response.positions], axis=0)
    assert_allclose(made, np.abs(x) < response.width / 2, atol=ROUNDING)


@given(responses)
def test_the_product_of_the_transforms_is_that_of_the_rectangle(response):
    k = np.linspace(-20, 20, 401) / response.width
    made = response.transform(k) * source_transform(k, response.sources, response.spacing)
    # up to 2^4 terms with arguments up to 20 pi, each exact to eps times its argument
    assert_allclose(made, response.width * np.sinc(k * response.width), atol=1e-11 * response.width)


@given(responses)
def test_the_transform_of_the_pieces(response):
    """Each piece has the transform N sin(pi k s) / (pi k), turned by its place."""
    k = np.linspace(-9, 9, 91) / response.width
    turned = np.cos(2 * np.pi * np.outer(k, response.centres)).sum(axis=1)
    direct = response.sources * response.spacing * np.sinc(k * response.spacing) * turned
    assert_allclose(response.transform(k), direct, atol=1e-11 * response.width)


@given(st.integers(1, 9), st.floats(0.1, 2))
def test_the_sources_are_a_dirichlet_kernel(sources, spacing):
    """(7.14) with N terms."""
    k = (np.arange(50) + 0.3) / 50 / spacing
    expected = np.sin(np.pi * sources * k * spacing) / (sources * np.sin(np.pi * k * spacing))
    assert_allclose(source_transform(k, sources, spacing), expected, atol=1e-11)


@pytest.mark.parametrize(
    ("sources", "splits", "pixels"), [(2, 0, 8), (2, 1, 4), (2, 3, 3), (3, 2, 3), (5, 1, 4), (7, 0, 2)]
)
def test_the_solver_finds_them(sources, splits, pixels):
    """Light on finitely many pixels that makes the rectangle is unique: products of polynomials have one
    quotient."""
    kernel, light = RectangleResponse(1.0, sources, splits).on_pixels(pixels)
    margin = kernel.weights.shape[1]
    target = np.pad(np.ones((1, pixels * sources * 2**splits)), ((0, 0), (margin, margin)))
    result = approximate(kernel, target, 1e-12)
    start = np.flatnonzero(result.solution[0] > 0.5)[0]
    expected = np.zeros(result.solution.shape)
    expected[0, start : start + light.shape[1]] = light
    assert_allclose(result.solution, expected, atol=1e-8)
    assert result.residual <= 1e-8


@pytest.mark.parametrize(
    ("arguments", "words"), [((0.0, 2), "width"), ((1.0, 0), "sources"), ((1.0, 2, -1), "splits")]
)
def test_errors_name_the_argument(arguments, words):
    with pytest.raises(ValueError, match=words):
        RectangleResponse(*arguments)
