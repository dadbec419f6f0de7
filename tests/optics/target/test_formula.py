"""What a formula means."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from optics.target.formula import SUBPOINTS, formula_light
from tests.optics.target.cases import MANY, PLAIN, expressions, means, refusal


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
