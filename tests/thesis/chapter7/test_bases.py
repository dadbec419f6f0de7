"""Non-negative bases: their functions and the approximation with them."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.stats import beta as beta_distribution, irwinhall

from examples.thesis.chapter7.bases import BasisBlur, approximate_in_basis, bates, beta, deltas, irwin_hall
from optics.designing.etendue import Kernel, approximate
from tests.cases import examples
from tests.optics.designing.etendue.cases import kernels, matrix, optimum, targets

ROUNDING = 1e-12  # sums of some hundred numbers up to 1; B-splines of up to 6 pieces


@given(st.integers(1, 6), st.sampled_from([1.0, 2.0, 2.5]), st.integers(3, 20))
def test_irwin_hall_functions_are_densities_of_sums(terms, spacing, pixels):
    basis = irwin_hall(pixels, terms, spacing)
    first = spacing - terms * spacing
    for i in range(basis.shape[1]):
        edges = (np.arange(pixels + 1) - first - i * spacing) / spacing
        assert_allclose(basis[:, i], np.diff(irwinhall(terms).cdf(edges)), atol=ROUNDING)
    assert_allclose(basis.sum(axis=1), 1 / spacing, rtol=ROUNDING)  # partition of unity up to the border


@given(st.integers(1, 6), st.floats(1, 8), st.floats(0.5, 4))
def test_bates_functions_are_densities_of_means(terms, width, spacing):
    basis = bates(30, terms, width, spacing)
    inside = np.flatnonzero((basis[0] == 0) & (basis[-1] == 0))
    assert_allclose(basis[:, inside].sum(axis=0), 1, rtol=ROUNDING)
    centres = np.arange(30) + 0.5
    spread = ((centres**2) @ basis - (centres @ basis) ** 2)[inside]
    # the variance of a mean is width^2 / (12 terms); pixels add 1/12, less twice the error of the pixel's
    # middle
    assert (np.abs(spread - width**2 / (12 * terms)) <= 1 / 4).all()


def test_beta_functions_are_areas_of_the_density():
    basis = beta(8, (4.0, 6.0), (4, 3))
    assert basis.shape == (8, 12)
    assert_allclose(basis.sum(axis=0), 1, rtol=ROUNDING)
    density = beta_distribution(3.0, 4.0).pdf  # a = 3 A / N_a, b = 2 B / N_b
    assert_allclose(basis[:, 2 * 3 + 1], [quad(density, i / 8, (i + 1) / 8)[0] for i in range(8)], atol=1e-10)


@pytest.mark.slow
@examples(60)
@given(kernels(), targets())
def test_deltas_are_the_general_problem(kernel, target):
    """With steps enough to converge: an ill-conditioned blur takes more than the default 5000."""
    rows, columns = (deltas(side) for side in kernel.light_shape(target.shape))
    result = approximate_in_basis(kernel, target, rows, columns, 1e-6, 10_000)
    best = optimum(matrix(kernel, target.shape), target)
    assert result.lower_bound - ROUNDING <= best <= result.residual + ROUNDING
    assert result.residual**2 <= best**2 + 1e-4


@given(kernels(), targets(), st.integers(1, 3))
def test_a_basis_reaches_its_own_optimum(kernel, target, terms):
    rows, columns = (irwin_hall(side, terms, 2.0) for side in kernel.light_shape(target.shape))
    result = approximate_in_basis(kernel, target, rows, columns, 1e-6)
    best = optimum(matrix(kernel, target.shape) @ np.kron(rows, columns), target)
    assert result.lower_bound - ROUNDING <= best <= result.residual + ROUNDING
    assert_allclose(result.image, kernel.apply(result.solution), atol=ROUNDING)
    assert (
        approximate(kernel, target).lower_bound <= result.residual + ROUNDING
    )  # a basis only restricts the light


@given(kernels(), targets())
def test_the_map_of_coefficients_and_its_adjoint(kernel, target):
    blur = BasisBlur(kernel, *(irwin_hall(side, 2, 1.5) for side in kernel.light_shape(target.shape)))
    weights = np.random.default_rng(0).random((blur.rows.shape[1], blur.columns.shape[1]))
    assert_allclose(
        (blur.apply(weights) * target).sum(), (weights * blur.adjoint(target)).sum(), rtol=ROUNDING
    )
    assert blur.apply(np.ones_like(weights)).max() <= 1 + ROUNDING


def test_beta_light_is_certified():
    kernel, x = Kernel.disk(2), np.linspace(-1, 1, 24)
    target = np.maximum(1 - np.hypot(x[:, None], x), 0)
    basis = beta(28, (6.0, 6.0), (4, 4))
    result = approximate_in_basis(kernel, target, basis, basis, 1e-4)
    assert result.lower_bound <= result.residual <= 0.2
    assert (result.solution >= 0).all()


def test_errors_in_one_sentence():
    with pytest.raises(ValueError, match="rows must hold non-negative columns of 13 pixels"):
        approximate_in_basis(Kernel.disk(2), np.ones((9, 9)), deltas(9), deltas(13))
    with pytest.raises(ValueError, match="columns must hold"):
        approximate_in_basis(Kernel.disk(2), np.ones((9, 9)), deltas(13), -deltas(13))
    with pytest.raises(ValueError, match="terms"):
        irwin_hall(9, 0)
    with pytest.raises(ValueError, match="spacing"):
        bates(9, 2, 3.0, 0.0)
