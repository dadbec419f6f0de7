"""Richardson-Lucy deconvolution, with a known and with an unknown source."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import convolve
from skimage.restoration import richardson_lucy as reference

from examples.thesis.chapter7.multiplicative import blind_deconvolution, richardson_lucy
from optics.designing.etendue import Kernel, approximate

X = np.linspace(-1, 1, 48)
TARGET = (np.hypot(X[:, None], X) < 0.4).astype(float)


def divergence(target, image):
    lit = target > 0
    return float((target[lit] * np.log(target[lit] / image[lit])).sum() - target.sum() + image.sum())


def test_the_divergence_falls():
    kernel = Kernel.disk(3)
    values = [
        divergence(TARGET, richardson_lucy(kernel, TARGET, steps).image) for steps in (1, 3, 10, 30, 100)
    ]
    assert values == sorted(values, reverse=True)


def test_the_flux_is_that_of_the_target():
    """After a step the light brings sum of G onto the image: the factors sum to it."""
    result = richardson_lucy(Kernel.disk(3), TARGET, 5)
    assert_allclose(result.image.sum(), TARGET.sum(), rtol=1e-12)
    assert (result.solution >= 0).all()


def test_the_least_squares_are_better():
    kernel = Kernel.disk(3)
    best = approximate(kernel, TARGET)
    assert richardson_lucy(kernel, TARGET, 200).residual > best.residual
    assert best.lower_bound > 0.9 * best.residual


def test_scikit_image_agrees_inside():
    """Its convolution keeps the size, so that the border differs: with light far from it the steps are the
    same.

    It clips to [-1, 1] unless told and adds 1e-12 to the image.
    """
    kernel = Kernel(np.array([[1, 2, 1], [2, 4, 3], [1, 2, 1.0]]))
    wide = np.pad(TARGET, 20) + 1e-3
    own = richardson_lucy(kernel, wide, 8).light
    other = reference(wide, kernel.weights, num_iter=8, clip=False)
    inside = (slice(20, -20),) * 2  # 8 steps carry the border 16 pixels inwards
    assert_allclose(own[inside], other[inside], rtol=1e-6)


def test_a_blind_point_leaves_the_target():
    """The first trivial solution: a point stays a point, and the light is the target."""
    kernel, result = blind_deconvolution(Kernel(np.eye(1)), TARGET, 2)
    assert kernel.weights.tolist() == [[1.0]]
    assert_allclose(result.light, TARGET, atol=1e-12)


def test_blind_deconvolution_improves_on_its_guess():
    guess = Kernel(np.ones((7, 7)))
    made = convolve(TARGET, Kernel.disk(2).weights, "same", "direct")  # with exact zeros
    kernel, result = blind_deconvolution(guess, made, 20)
    fixed = richardson_lucy(guess, made, 100)
    assert divergence(made, result.image) < divergence(made, fixed.image)
    assert result.residual < fixed.residual
    assert_allclose(kernel.weights.sum(), 1)
    assert (kernel.weights >= 0).all()


def test_errors_in_one_sentence():
    with pytest.raises(ValueError, match="steps"):
        richardson_lucy(Kernel.disk(3), TARGET, 0)
    with pytest.raises(ValueError, match="rounds"):
        blind_deconvolution(Kernel.disk(3), TARGET, 0)
    with pytest.raises(ValueError, match="not negative"):
        richardson_lucy(Kernel.disk(3), -TARGET, 1)
