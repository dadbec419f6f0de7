"""Certified minima and Bezier extraction."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.thbcad.strategies import knot_vectors
from thbcad.bounds import minimum
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
