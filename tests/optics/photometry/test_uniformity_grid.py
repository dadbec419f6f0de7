"""Uniformity of known images."""

import numpy as np
import pytest

from optics.photometry import uniformity


def test_a_known_image_has_its_ratios_on_the_lit_pixels_only():
    light = np.array([[0.0, 100.0, 7.0], [4.0, 6.0, 8.0]])
    lit = np.array([[False, False, True], [True, True, True]])
    found = uniformity(light, lit)
    assert (found.mean, found.min_over_mean, found.min_over_max) == pytest.approx((6.25, 4 / 6.25, 0.5))


@pytest.mark.parametrize(("value", "lit"), [(1.0, False), (0.0, True), (-1e-20, True)])
def test_without_lit_pixels_or_light_there_is_none(value, lit):
    assert uniformity(np.full((2, 3), value), np.full((2, 3), lit)) is None


def test_rounding_below_zero_is_dark():
    found = uniformity(np.array([[-1e-18, 2.0]]), np.ones((1, 2), dtype=bool))
    assert (found.min_over_mean, found.min_over_max) == (0, 0)
