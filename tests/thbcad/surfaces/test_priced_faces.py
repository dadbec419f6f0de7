"""Faces between one with all needed knots and many small ones."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.cases import examples
from tests.thbcad.cases import coefficients, points, spaces
from thbcad import KnotVector, THBSpace, THBSurface

PRICES = (0.0, 5.0, 30.0, 200.0, np.inf)


def size(faces):
    return sum(f.kv_u.dim * f.kv_v.dim for f in faces)


@examples(30)
@given(st.data(), st.sampled_from(PRICES))
def test_faces_are_the_surface_and_tile_it(data, price):
    """Least squares on fewer knots lose up to 2^p roundings; spans of ratio 9 and multiple knots are among
    the examples."""
    space = data.draw(spaces(max_spans=4))
    surface = THBSurface(space, data.draw(coefficients(space.dim, 2)))
    faces = surface.to_faces(price)
    area = sum((f.kv_u.stop - f.kv_u.start) * (f.kv_v.stop - f.kv_v.start) for f in faces)
    assert area == pytest.approx(
        (space.kv_u.stop - space.kv_u.start) * (space.kv_v.stop - space.kv_v.start), rel=1e-12
    )
    u, v = data.draw(points(space))
    held = np.zeros(len(u), dtype=int)
    for f in faces:
        inside = (f.kv_u.start <= u) & (u <= f.kv_u.stop) & (f.kv_v.start <= v) & (v <= f.kv_v.stop)
        held += inside
        assert np.allclose(f(u[inside], v[inside]), surface(u[inside], v[inside]), rtol=0, atol=1e-12)
    assert held.min() > 0


@examples(30)
@given(spaces(max_spans=4, max_degree=2))
def test_a_higher_price_means_fewer_faces(space):
    surface = THBSurface(space, np.zeros(space.dim))
    found = [surface.to_faces(price) for price in PRICES]
    assert all(len(a) >= len(b) for a, b in pairwise(found))
    assert all(size(a) <= size(b) for a, b in pairwise(found))
    assert len(found[-1]) == 1
    assert size(found[-1]) == space.embedding.kv_u.dim * space.embedding.kv_v.dim


def test_a_refined_corner_becomes_a_face_of_its_own():
    """Full: 27 x 27 points. Bisected at 1/2: the corner has 19 x 19, the quarter beside it 11 x 11, the other
    half 11 x 19."""
    kv = KnotVector.uniform(3, 16)
    space = THBSpace(kv, kv).refine({0: np.argwhere(np.ones((8, 8)))})
    surface = THBSurface(space, np.random.default_rng(0).normal(size=space.dim))
    assert [f.coefficients.shape for f in surface.to_faces(np.inf)] == [(27, 27)]
    assert sorted(f.coefficients.shape for f in surface.to_faces(10)) == [(11, 11), (11, 19), (19, 19)]
    assert len(surface.to_patches()) == 3
