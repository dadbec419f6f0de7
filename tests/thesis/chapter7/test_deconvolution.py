"""Regularised deconvolution: when a response exists, and how it breaks."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose
from scipy import fft
from scipy.linalg import eigvalsh, toeplitz

from examples.thesis.chapter7.deconvolution import (
    EPSILON,
    deconvolve,
    figure_7_4,
    least_eigenvalue,
    points_transform,
    rectangle_case,
    uncovered_zero,
)

NEAREST = (
    np.pi * 1e-5 / 2
)  # |G^| / 2 where a frequency is nearest to a zero: a period of 10.0001 misses k = 1 by 1e-5


def test_the_first_case_of_figure_7_4_is_a_rectangle():
    """Sources at +-1/4 and a rectangle of half-width 1/2: the response is the rectangle of half-width 1/4.

    epsilon takes the share epsilon / |G^|^2 from the frequencies near the zeros of G^, some of the 100,001.
    """
    case = figure_7_4()[0]
    expected = np.where(np.isclose(np.abs(case.x), 0.25), 0.5, np.abs(case.x) < 0.25)
    assert_allclose(case.response, expected, atol=10 * EPSILON / NEAREST**2)
    assert case.negative <= 1e-4
    assert case.outside <= 1e-4


def test_a_wider_rectangle_or_a_moved_source_break_it():
    _, wider, moved = figure_7_4()
    for case in (wider, moved):
        assert case.response.min() < -0.4
        assert case.negative > 0.25
        assert case.outside > 0.5  # no bounded support


def test_the_smaller_half_width_of_the_thesis_has_no_solution():
    """Read as a full width 0.5 (7.15), the first case fails too (errata)."""
    case = rectangle_case(0.25, (-0.25, 0.25))
    assert case.negative > 0.25
    assert uncovered_zero(np.eye(1, 51)[0] + np.eye(1, 51, 50)[0], np.ones(50)) > 0.01


@given(st.integers(0, 2**32 - 1))
def test_deconvolution_inverts_a_blur_without_zeros(seed):
    rng = np.random.default_rng(seed)
    response = rng.random(64)
    taps = np.array([1.0, *rng.uniform(0, 0.3, 3)])  # the first tap is more than the others: |G^| >= 0.1
    transform = fft.rfft(taps, 64)
    target = fft.irfft(transform * fft.rfft(response), 64)
    assert_allclose(deconvolve(target, transform, 0.0), response, atol=1e-12)
    # epsilon damps every frequency by 1 / (1 + epsilon / |G^|^2)
    assert_allclose(deconvolve(target, transform, 1e-8), response, atol=1e-8 / 0.1**2 * 64)


def test_two_sources_have_the_zeros_of_a_cosine():
    k = np.linspace(-7, 7, 57)
    assert_allclose(points_transform(k, [-0.25, 0.25]), 2 * np.cos(np.pi * k / 2), atol=1e-14)


@given(
    st.lists(st.integers(1, 5), min_size=1, max_size=4),
    st.lists(st.integers(0, 5), min_size=1, max_size=6).filter(any),
)
def test_what_a_response_makes_covers_all_zeros(weights, response):
    """A root of multiplicity 3 at most, of degree 3 at most, is found to eps^(1/3) = 6e-6 times a condition
    number."""
    assert uncovered_zero(weights, np.convolve(weights, response)) <= 1e-3


@pytest.mark.parametrize(("width", "exists"), [(10, True), (20, True), (11, False), (15, False), (30, True)])
def test_the_zeros_tell_which_rectangles_two_sources_make(width, exists):
    """1 + z^5 divides 1 + z + ... + z^(w - 1) where w is a multiple of 10."""
    defect = uncovered_zero([1, 0, 0, 0, 0, 1], np.ones(width))
    assert (defect <= 1e-12) == exists


def test_sources_without_zeros_prove_nothing():
    assert uncovered_zero([2, 0, 1], [1, 1, 1]) == 0


@given(st.lists(st.floats(0, 1), min_size=5, max_size=12).filter(any))
def test_bochner(response):
    """The transform of a non-negative response is positive definite; Theorem 1: |Phi(x)| <= Phi(0)."""
    phi = fft.fft(response)
    assert least_eigenvalue(phi) >= -1e-12
    assert (np.abs(phi) <= phi[0].real + 1e-12).all()
    assert eigvalsh(toeplitz(phi)).min() >= -1e-11


def test_bochner_by_the_matrix_and_a_response_that_is_negative():
    response = np.array([1.0, -0.25, 0.5, 0.125])
    phi = fft.fft(response)
    values = eigvalsh(toeplitz(phi))
    assert_allclose(least_eigenvalue(phi), values.min() / np.abs(values).max())
    assert least_eigenvalue(phi) == pytest.approx(-0.25)


def test_one_over_the_transform_of_two_sources_is_not_positive_definite():
    """Thesis 7.2: only a single source has 1 / G^ of constant size."""
    transform = fft.fft([1.0, 0, 0.5, 0, 0, 0, 0])
    assert least_eigenvalue(transform) >= -1e-15
    assert least_eigenvalue(1 / transform) < -0.1
    assert least_eigenvalue(1 / fft.fft([1.0, 0, 0, 0, 0])) >= -1e-15


def test_errors_in_one_sentence():
    with pytest.raises(ValueError, match="flux"):
        uncovered_zero([0, 0], [1, 1])
    with pytest.raises(ValueError, match="hermitian"):
        least_eigenvalue([1, 2, 3])
