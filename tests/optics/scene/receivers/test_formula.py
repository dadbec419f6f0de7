"""What a formula means."""

import re

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from optics.scene.receivers.formula import MAX_LENGTH, SUBPOINTS, formula_light, formula_pixels
from tests.optics.scene.receivers.cases import MANY, PLAIN, expressions, means, refusal


@pytest.mark.parametrize("text", PLAIN)
def test_formulas_are_as_numpy_computes_them(text):
    """To 1e-12 of the brightest pixel: terms of size 4 at most, a few thousand roundings of 1e-16."""
    np.testing.assert_allclose(formula_light(text, (24, 14)), means(PLAIN[text], (24, 14)), atol=1e-12)


@given(part=expressions(), pixels=st.tuples(st.integers(2, 6), st.integers(2, 6)))
@MANY
def test_random_formulas_are_as_an_independent_evaluator_has_them(part, pixels):
    """The same operations in the same order at every place: only the means are rounded otherwise."""
    text, _, function = part
    columns, rows = pixels
    x, y = ((2 * np.arange(n * SUBPOINTS) + 1 - n * SUBPOINTS) / (n * SUBPOINTS) for n in pixels)
    with np.errstate(all="ignore"):
        values = np.broadcast_to(
            np.abs(function(x[None, :], -y[:, None])), (rows * SUBPOINTS, columns * SUBPOINTS)
        )
    text = f"abs({text})"
    if not np.isfinite(values).all():
        assert re.match(r"target\.formula is (not a number|infinite) at x = ", refusal(text, pixels))
    elif not values.any():
        assert "0 everywhere" in refusal(text, pixels)
    else:
        assume(values.max() > 1e-290)  # below, numbers have fewer digits
        light = (values / values.max()).reshape(rows, SUBPOINTS, columns, SUBPOINTS).mean(axis=(1, 3))
        np.testing.assert_allclose(formula_light(text, pixels), light / light.max(), rtol=1e-13, atol=1e-300)


def test_pixels_are_lit_wholly_where_no_sample_point_is_dark():
    """A disk that is shifted; of a pixel outside the disk or on its rim the farthest sample point is out."""
    pixels, text = (30, 20), "where(hypot(x - 0.1, y - 0.2) < 0.7, 3, 0)"
    ends = [
        np.abs((2 * np.arange(n) + 1) / n - 1 - at) + (1 - 1 / SUBPOINTS) / n
        for n, at in zip(pixels, (0.1, -0.2))
    ]
    wanted = np.hypot(ends[0][None, :], ends[1][:, None]) < 0.7
    assert 50 < wanted.sum() < (formula_light(text, pixels) > 0).sum()
    np.testing.assert_array_equal(formula_pixels(text, pixels), wanted)


def test_the_longest_formula_has_pixels_too():
    text = "1" + "+ 1" * ((MAX_LENGTH - 1) // 60) + " " * 2000
    assert formula_pixels(text[:MAX_LENGTH], (4, 3)).all()
