"""Spans are found as a bisection finds them, but for points within rounding of a break."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.light.intersections.spans import Cells
from tests.cases import examples


def expected(breaks, points):
    return np.clip(np.searchsorted(breaks, points, "right") - 1, 0, len(breaks) - 2)


@examples(60)
@given(
    widths=st.lists(st.floats(1e-3, 10), min_size=1, max_size=40),
    start=st.floats(-100, 100),
    seed=st.integers(0, 99),
)
def test_any_breaks(backend, widths, start, seed):
    breaks = start + np.concatenate([[0.0], np.cumsum(widths)])
    points = np.random.default_rng(seed).uniform(breaks[0], breaks[-1], 500)
    found = Cells(backend, breaks)(backend.array(points)).numpy()
    away = np.abs(points[:, None] - breaks).min(axis=1) > 1e-9 * (breaks[-1] - breaks[0])
    np.testing.assert_array_equal(found[away], expected(breaks, points)[away])


@pytest.mark.parametrize("kept", [1.0, 0.4], ids=["uniform", "dyadic with gaps"])
def test_breaks_of_dyadic_meshes_are_found_on_either_side(backend, kept):
    """A point on a break belongs to one of the two spans that meet there."""
    fine = np.linspace(-50.0, 50.0, 7 * 32 + 1)
    breaks = np.concatenate(
        [fine[:1], fine[1:-1][np.random.default_rng(0).random(len(fine) - 2) < kept], fine[-1:]]
    )
    found = Cells(backend, breaks)(backend.array(breaks)).numpy()
    right = expected(breaks, breaks)
    assert (np.abs(found.astype(int) - right) <= 1).all()
    middles = (breaks[1:] + breaks[:-1]) / 2
    np.testing.assert_array_equal(
        Cells(backend, breaks)(backend.array(middles)).numpy(), np.arange(len(middles))
    )


def test_spans_of_very_different_width(backend):
    """More than the bins can tell apart: steps lead to the span."""
    breaks = np.concatenate([[0.0], np.cumsum(10.0 ** -np.arange(0, 9))])
    points = (breaks[1:] + breaks[:-1]) / 2
    np.testing.assert_array_equal(
        Cells(backend, breaks)(backend.array(points)).numpy(), np.arange(len(points))
    )


def test_points_beside_the_breaks_have_the_spans_at_the_ends(backend):
    found = Cells(backend, np.array([0.0, 1.0, 3.0]))(backend.array([-1e9, -1e-300, 3.0, 1e9])).numpy()
    assert found.tolist() == [0, 0, 1, 1]


def test_what_is_no_number_has_the_first_span(backend):
    """Else it would be read beside the table."""
    assert Cells(backend, np.array([0.0, 1.0, 3.0]))(backend.array([np.nan, 2.0])).numpy().tolist() == [0, 1]
