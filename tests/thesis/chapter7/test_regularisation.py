"""Regularised deblurring, against dense algebra and a general optimiser."""

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose
from scipy.optimize import minimize

from examples.thesis.chapter7.comparison import CASES, compare
from examples.thesis.chapter7.regularisation import (
    conjugate_gradients,
    laplacian_gradients,
    maximum_entropy,
)
from optics.designing.etendue import Kernel
from tests.optics.designing.etendue.cases import kernels, matrix, targets


def above(kernel, target):
    """Return the blur as a matrix of the light above the image only."""
    (i, j), (n, m) = (side // 2 for side in kernel.weights.shape), target.shape
    whole = matrix(kernel, target.shape).reshape(n * m, n + 2 * i, m + 2 * j)
    return whole[:, i : i + n, j : j + m].reshape(n * m, n * m)


def cgls(a, g, steps):
    """Conjugate gradients on the normal equations (Hestenes and Stiefel)."""
    x, r = np.zeros(a.shape[1]), g.copy()
    s = p = a.T @ r
    for _ in range(steps):
        if not s @ s > 1e-30:  # solved
            break
        q = a @ p
        alpha = (s @ s) / (q @ q)
        x, r, before = x + alpha * p, r - alpha * q, s
        s = a.T @ r
        p = s + (s @ s) / (before @ before) * p
    return x


@given(kernels(), targets())
def test_lsqr_has_the_iterates_of_cgls(kernel, target):
    for steps in (1, 2, 3):
        expected = cgls(above(kernel, target), target.ravel(), steps)
        assert_allclose(
            conjugate_gradients(kernel, target, steps).ravel(), expected, atol=1e-8 * np.abs(expected).max()
        )


@given(kernels(), targets())
def test_the_laplacian_is_the_five_point_one(kernel, target):
    def second(side):
        matrix = 2 * np.eye(side) - np.eye(side, k=1) - np.eye(side, k=-1)
        matrix[0, 0] = matrix[-1, -1] = 3  # odd about the edge: the value beyond it is minus that before it
        return matrix

    n, m = target.shape
    laplacian = np.kron(second(n), np.eye(m)) + np.kron(np.eye(n), second(m))
    inverse = np.linalg.inv(laplacian)
    expected = inverse @ cgls(above(kernel, target) @ inverse, target.ravel(), 2)
    assert_allclose(
        laplacian_gradients(kernel, target, 2).ravel(), expected, atol=1e-8 * np.abs(expected).max()
    )


@given(
    kernels(),
    targets(),
)
def test_maximum_entropy_is_the_minimum(kernel, target):
    """The gradient of the convex objective vanishes: 2 A^T (A F - G) + mu^2 (log F + 1) = 0."""
    mu, a = 0.5, above(kernel, target)
    light = maximum_entropy(kernel, target, mu).ravel()
    slope = 2 * a.T @ (a @ light - target.ravel()) + mu**2 * (np.log(light) + 1)
    assert (light > 0).all()
    assert np.abs(slope).max() <= 1e-6 * np.linalg.norm(target)


def test_maximum_entropy_against_another_optimiser():
    kernel, target, mu = Kernel.disk(1.5), np.pad(np.ones((3, 3)), 2), 0.3
    a = above(kernel, target)

    def objective(f):
        error = a @ f - target.ravel()
        return error @ error + mu**2 * (f * np.log(f)).sum(), 2 * a.T @ error + mu**2 * (np.log(f) + 1)

    found = minimize(
        objective,
        np.full(49, 0.5),
        jac=True,
        bounds=[(1e-12, None)] * 49,
        options={"ftol": 1e-15, "gtol": 1e-10, "maxiter": 5000},
    )
    assert_allclose(maximum_entropy(kernel, target, mu).ravel(), found.x, atol=1e-5)


@pytest.mark.slow
def test_conjugate_gradients_find_a_solution_that_exists():
    """Figure 7.9: 50 steps give the non-negative response of the square and a shift of 8 pixels; Figure 7.10:
    they do not."""
    best, responses = compare(CASES[0])
    assert_allclose(responses["conjugate gradients"].light, best.light, atol=1e-10)
    best, responses = compare(CASES[1])
    assert responses["conjugate gradients"].least < -0.5
    assert responses["with Laplacian"].least < -0.1
    assert responses["maximum entropy"].least >= 0
    assert best.lower_bound <= responses["maximum entropy"].residual <= 1.01 * best.residual


def test_errors_in_one_sentence():
    with pytest.raises(ValueError, match="mu"):
        maximum_entropy(Kernel.disk(1), np.ones((9, 9)), 0.0)
    with pytest.raises(ValueError, match="steps"):
        conjugate_gradients(Kernel.disk(1), np.ones((9, 9)), 0)
    with pytest.raises(ValueError, match="not negative"):
        laplacian_gradients(Kernel.disk(1), -np.ones((9, 9)), 5)
