"""Kernels: taps by area, the linear convolution and its adjoint."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose
from scipy.signal import convolve

from optics.designing.etendue import kernel as module
from optics.designing.etendue.kernel import Kernel
from tests.cases import examples
from tests.optics.designing.etendue.cases import kernels, matrix, targets

EPS = np.finfo(np.float64).eps
ROUNDING = (
    100 * EPS
)  # sums of up to 49 taps of sum 1, and transforms of some hundred samples, of numbers up to 1


@given(kernels(), targets(), st.integers(0, 2**32 - 1))
def test_the_blur_is_the_linear_convolution(kernel, target, seed):
    light = np.random.default_rng(seed).random(kernel.light_shape(target.shape))
    assert_allclose(kernel.apply(light), convolve(light, kernel.weights, "valid", "direct"), atol=ROUNDING)
    assert_allclose(kernel.apply(light).ravel(), matrix(kernel, target.shape) @ light.ravel(), atol=ROUNDING)


@given(kernels(), targets(), st.integers(0, 2**32 - 1))
def test_the_adjoint_is_the_transpose(kernel, target, seed):
    light = np.random.default_rng(seed).random(kernel.light_shape(target.shape))
    assert_allclose(
        (kernel.apply(light) * target).sum(), (light * kernel.adjoint(target)).sum(), rtol=ROUNDING
    )
    assert_allclose(
        kernel.adjoint(target).ravel(), matrix(kernel, target.shape).T @ target.ravel(), atol=ROUNDING
    )


@given(kernels(), targets())
def test_the_reach_is_the_flux_that_arrives(kernel, target):
    reach = kernel.column_sums(target.shape)
    assert_allclose(reach.ravel(), matrix(kernel, target.shape).sum(axis=0), rtol=ROUNDING)
    assert ((reach > 0) == (matrix(kernel, target.shape).sum(axis=0).reshape(reach.shape) > 0)).all()


@given(kernels(), targets())
def test_few_and_many_taps_give_the_same(kernel, target):
    light = np.random.default_rng(1).random(kernel.light_shape(target.shape))
    with pytest.MonkeyPatch.context() as patch:
        found = []
        for few in (0, 10_000):
            patch.setattr(module, "FEW_TAPS", few)
            found.append((kernel.apply(light), kernel.adjoint(target)))
    for by_transform, by_shifts in zip(*found):
        assert_allclose(by_transform, by_shifts, atol=ROUNDING)


@given(kernels(), targets())
def test_flux_is_kept(kernel, target):
    """Light that is wholly above the middle of a padded image arrives wholly: weights of sum 1."""
    light = np.pad(target, [(side, side) for side in np.subtract(kernel.weights.shape, 1)])
    assert_allclose(kernel.weights.sum(), 1, rtol=ROUNDING)
    assert_allclose(kernel.apply(light).sum(), target.sum(), rtol=ROUNDING)


@pytest.mark.parametrize(
    "kernel", [Kernel.disk(2.5), Kernel.points([(0, 1), (2, 0)], [1, 2])], ids=["transforms", "shifts"]
)
def test_single_precision_stays_single(kernel):
    light = np.random.default_rng(3).random(kernel.light_shape((20, 30)))
    assert (
        kernel.apply(light.astype(np.float32)).dtype
        == kernel.adjoint(np.ones((20, 30), np.float32)).dtype
        == np.float32
    )
    assert_allclose(
        kernel.apply(light.astype(np.float32)), kernel.apply(light), atol=20 * np.finfo(np.float32).eps
    )


@pytest.mark.parametrize("radius", [0.3, 0.5, 0.9, 1.5, 2.0, 3.3, 17.25])
def test_the_taps_of_a_disk_are_areas(radius):
    """Against strips of height 1e-3, exact along the other axis: the trapezoidal error is below 1e-4 at the
    vertical tangents."""
    kernel = Kernel.disk(radius)
    middle = kernel.weights.shape[0] // 2
    strips = np.arange(-1000 * (middle + 0.5), 1000 * (middle + 0.5)) / 1000 + 0.0005
    half = np.sqrt(np.maximum(radius**2 - strips**2, 0))
    edges = np.arange(-middle, middle + 2) - 0.5
    covered = np.clip(np.minimum(half[:, None], edges[1:]) - np.maximum(-half[:, None], edges[:-1]), 0, None)
    areas = covered.reshape(-1, 1000, len(edges) - 1).mean(axis=1)
    assert_allclose(kernel.weights * np.pi * radius**2, areas, atol=1e-4)
    assert_allclose(kernel.weights, kernel.weights[::-1].T, atol=ROUNDING)


def test_a_rectangle_is_antialiased():
    weights = Kernel.rectangle(1.0, 0.5).weights
    assert_allclose(weights, np.array([[0.25], [0.5], [0.25]]), atol=EPS)
    assert Kernel.rectangle(0.25, 0.5).weights.shape == (1, 1)


def test_points_add_up_and_sit_at_their_shifts():
    kernel = Kernel.points([(0, 0), (1, -2), (1, -2)], [2, 1, 1])
    assert kernel.weights.shape == (3, 5)
    assert kernel.weights[1, 2] == kernel.weights[2, 0] == 0.5


def test_an_even_picture_gets_a_dark_edge():
    kernel = Kernel.image([[1, 3]])
    assert_allclose(kernel.weights, [[0.25, 0.75, 0]])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Kernel(np.ones((2, 3))), "odd sides"),
        (lambda: Kernel([[1, -1, 1]]), r"not negative, got -1 at \(0, 1\)"),
        (lambda: Kernel([[1, np.nan, 1]]), r"got nan at \(0, 1\)"),
        (lambda: Kernel(np.zeros((3, 3))), "flux"),
        (lambda: Kernel(np.ones(3)), r"shape \(3,\)"),
        (lambda: Kernel.image(np.zeros((4, 4))), "flux"),
        (lambda: Kernel.points([(0, 0.5)], [1]), "whole numbers"),
        (lambda: Kernel.points([(0, 0)], [1, 2]), "n weights"),
        (lambda: Kernel.points([(0, 0), (1, 0)], [1, -2]), "not negative"),
        (lambda: Kernel.disk(0), "positive number of pixels, got 0"),
        (lambda: Kernel.rectangle(1, np.inf), "positive number of pixels, got inf"),
        (lambda: Kernel.disk(2).apply(np.ones((3, 9))), "smaller than the kernel"),
        (lambda: Kernel.disk(2).column_sums((3, 9)), "smaller than the kernel"),
    ],
)
def test_errors_in_one_sentence(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def exact_greatest_mean(kernel, image):
    """Return the greatest A^T y / A^T 1 where A^T 1 > 0, in Fractions."""
    a = matrix(kernel, image.shape)
    y = [Fraction(x) for x in image.ravel().tolist()]
    means = []
    for column in a.T:
        weights = {k: Fraction(column[k]) for k in np.flatnonzero(column).tolist()}
        if weights:
            means.append(sum(w * y[k] for k, w in weights.items()) / sum(weights.values()))
    return max(means)


@examples(10)
@given(kernels(), targets(), st.integers(0, 2**32 - 1), st.booleans())
def test_the_greatest_mean_is_rounded_upward(kernel, target, seed, faint):
    """Also of taps of 1e-13, which transforms drown: the pixels of light that they reach are summed."""
    if faint:
        kernel = Kernel.rectangle(2.5 + 1e-13, 1.5 + 1e-13)
    image = np.random.default_rng(seed).normal(size=target.shape)
    exact = exact_greatest_mean(kernel, image)
    found = kernel.greatest_mean(image)
    assert found >= exact
    # n_taps EPS max |y|, and a few operations
    assert found <= max(0, exact) * (1 + 40 * EPS) + 2 * kernel.weights.size * EPS * abs(image).max()


@given(kernels(), targets(), st.integers(0, 2**32 - 1))
def test_the_error_of_transforms_stays_within_its_bound(kernel, target, seed):
    image = np.random.default_rng(seed).normal(size=target.shape)
    if len(kernel.taps) > module.FEW_TAPS:
        error = abs(kernel.adjoint(image).ravel() - matrix(kernel, target.shape).T @ image.ravel()).max()
        # the sums tap by tap err too
        assert error <= module._transform_error(kernel.weights, image) + 60 * EPS * abs(image).max()
        assert error >= module._transform_error(kernel.weights, image) / 1e4
