"""Exact operators of one knot vector: Bezier extraction, segments, degree elevation."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import BPoly

from tests.thbcad.cases import knot_vectors, seeds
from thbcad import KnotVector


@given(knot_vectors(), seeds())
def test_bezier_extraction_against_scipy(kv, rng):
    """scipy evaluates the Bernstein coefficients, the kernel its own B-spline basis."""
    c = rng.normal(size=kv.dim)
    bernstein = (kv.bezier() @ c).reshape(kv.spans, kv.degree + 1).T
    u = np.clip(kv.start + np.linspace(0, 1, 33) * (kv.stop - kv.start), kv.start, kv.stop)
    assert np.allclose(BPoly(bernstein, kv.breaks)(u), kv.collocation(u) @ c, atol=1e-12)


@given(knot_vectors(max_degree=9), seeds())
def test_elevation_keeps_the_curve(kv, rng):
    c = rng.normal(size=kv.dim)
    finer = kv.elevate()
    operator = kv.elevation()
    u = np.clip(kv.start + np.linspace(0, 1, 41) * (kv.stop - kv.start), kv.start, kv.stop)
    assert finer.degree == kv.degree + 1
    assert operator.shape == (finer.dim, kv.dim)
    assert np.allclose(operator.sum(axis=1), 1, atol=1e-13)
    assert np.allclose(finer.collocation(u) @ (operator @ c), kv.collocation(u) @ c, atol=1e-12)


@given(knot_vectors(), st.data())
def test_segments_are_pieces_of_the_curve(kv, data):
    """Ends on breaks and between them; polar forms are convex combinations, so that the error does not grow
    with the degree."""
    shares = sorted(data.draw(st.lists(st.integers(0, 96), min_size=2, max_size=2, unique=True)))
    a, b = (kv.start + (kv.stop - kv.start) * s / 96 for s in shares)
    own, operator = kv.segment(max(a, kv.start), min(b, kv.stop))
    c = data.draw(seeds()).uniform(-1, 1, kv.dim)
    u = np.clip(np.linspace(own.start, own.stop, 23), own.start, own.stop)
    assert operator.min() >= 0
    assert np.allclose(operator.sum(axis=1), 1, atol=1e-13)
    assert np.allclose(own.collocation(u) @ (operator @ c), kv.collocation(u) @ c, atol=1e-13)


def test_the_two_halves_of_a_split_meet_with_all_their_derivatives():
    kv = KnotVector.uniform(4, 5)
    c = np.random.default_rng(3).normal(size=kv.dim)
    halves = [kv.segment(0.0, 0.37), kv.segment(0.37, 1.0)]
    for r in range(5):
        ends = [own.collocation([0.37], r) @ (operator @ c) for own, operator in halves]
        assert np.allclose(*ends, rtol=1e-9)


@pytest.mark.parametrize(("start", "stop"), [(0.5, 0.5), (0.6, 0.5), (-0.1, 0.5), (0.5, 1.1), (np.nan, 0.5)])
def test_segments_outside_are_refused(start, stop):
    with pytest.raises(ValueError, match=r"a segment needs|must be a number"):
        KnotVector.uniform(3, 4).segment(start, stop)
