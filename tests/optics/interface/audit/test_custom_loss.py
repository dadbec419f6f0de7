"""A custom loss: its gradient is found right, and wrong where it is."""

import numpy as np
import pytest

from optics.interface.audit.custom_loss import custom_loss, gradient_error

MATRIX = np.random.default_rng(1).standard_normal((6, 4))
TARGET = np.arange(1.0, 7.0)
AT = np.array([0.3, -0.2, 0.5, 0.1])


class LinearModel:
    """Light E = A c, whose derivative is A."""

    target = TARGET

    def vjp(self, coefficients):
        return MATRIX @ coefficients, lambda slope: MATRIX.T @ slope


def test_the_loss_is_the_squared_difference_from_the_target():
    value, gradient = custom_loss(LinearModel())(AT)
    difference = (MATRIX @ AT - TARGET) / 6.0
    assert value == pytest.approx(difference @ difference, rel=1e-14)
    np.testing.assert_allclose(gradient, MATRIX.T @ difference / 3.0, rtol=1e-13)


def test_a_right_gradient_agrees_with_differences_and_a_wrong_one_does_not():
    loss = custom_loss(LinearModel())
    assert gradient_error(loss, AT) < 1e-8
    wrong = np.array([1.0, 1.0, 1.0, 1.001])  # by a part in a thousand
    assert gradient_error(lambda c: (loss(c)[0], wrong * loss(c)[1]), AT) > 1e-6
