"""Certified minima and Bezier extraction."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BPoly

from tests.thbcad.strategies import knot_vectors
from thbcad.bounds import bezier_operator, minimum
from thbcad.bspline import KnotVector
from thbcad.surface import BSplineSurface


@given(knot_vectors(), knot_vectors(), st.integers(0, 2**32 - 1))
def test_minimum_brackets_every_sample(kv_u, kv_v, seed):
    rng = np.random.default_rng(seed)
    surface = BSplineSurface(kv_u, kv_v, rng.normal(size=(kv_u.dim, kv_v.dim)))
    found = minimum(surface)
    u, v = (np.minimum(kv.start + rng.random(40) * (kv.stop - kv.start), kv.stop) for kv in (kv_u, kv_v))
    scale = np.abs(surface.coefficients).max()
    assert found.lower <= surface.grid(u, v).min()
    assert found.lower <= found.value
    assert found.value - found.lower <= 1e-11 * scale
    assert surface([found.u], [found.v])[0] == pytest.approx(found.value, abs=1e-9 * scale)


def test_minimum_of_a_paraboloid_between_the_knots():
    kv = KnotVector.uniform(2, 3, -1, 1)
    x = kv.greville()
    square = (kv.knots[1:-2] * kv.knots[2:-1])[:, None]
    # (x - 0.1)^2 + (y + 0.2)^2 + 0.5
    c = square + square.T - 0.2 * x[:, None] + 0.4 * x[None, :] + 0.01 + 0.04 + 0.5
    found = minimum(BSplineSurface(kv, kv, c))
    assert found.lower <= 0.5 <= found.value + 1e-15
    assert found.value - found.lower < 1e-11
    assert (found.u, found.v) == pytest.approx((0.1, -0.2), abs=1e-5)


def test_a_valley_along_a_line_stops_early_and_stays_certified():
    """The least value is taken on a whole curve between knots: the search must end, with lower <= 0."""
    kv = KnotVector.uniform(2, 64, -1, 1)
    square = kv.knots[1:-2] * kv.knots[2:-1]
    x = kv.greville()
    c = (square - 2 * x / 3 + 1 / 9)[:, None] + np.zeros(kv.dim)
    found = minimum(BSplineSurface(kv, kv, c))
    assert -1e-6 < found.lower <= 1e-16
    assert 0 <= found.value < 1e-6


@given(knot_vectors(), st.integers(0, 2**32 - 1))
def test_bezier_extraction_against_scipy(kv, seed):
    """scipy evaluates the Bernstein coefficients, the kernel its own B-spline basis."""
    c = np.random.default_rng(seed).normal(size=kv.dim)
    bernstein = (bezier_operator(kv) @ c).reshape(kv.spans, kv.degree + 1).T
    piecewise = BPoly(bernstein, kv.breaks)
    u = kv.start + np.linspace(0, 1, 33) * (kv.stop - kv.start)
    u = np.clip(u, kv.start, kv.stop)
    assert np.allclose(piecewise(u), kv.collocation(u) @ c, atol=1e-12)


@given(knot_vectors(max_degree=9), st.integers(0, 2**32 - 1))
def test_elevation_keeps_the_curve(kv, seed):
    c = np.random.default_rng(seed).normal(size=kv.dim)
    finer = kv.elevate()
    operator = kv.elevation()
    u = np.clip(kv.start + np.linspace(0, 1, 41) * (kv.stop - kv.start), kv.start, kv.stop)
    assert finer.degree == kv.degree + 1
    assert operator.shape == (finer.dim, kv.dim)
    assert np.allclose(operator.sum(axis=1), 1, atol=1e-13)
    assert np.allclose(finer.collocation(u) @ (operator @ c), kv.collocation(u) @ c, atol=1e-12)
