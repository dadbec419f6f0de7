"""The multilevel generating system against its definition: a sum of scaled B-splines of all levels."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import BSpline

from oracles.spline_definitions import bisected, gamma, support
from tests.cases import examples
from tests.thbcad.cases import hierarchies, points, seeds
from thbcad.hierarchy.multilevel_basis import MultilevelBasis
from thbcad.hierarchy.thb_space import THBSpace
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


def generating_system(space, refined, u, v):
    """Return the values of 2^-l N_(l,i,j) at points, one column for each function supported in Omega_l, by
    scipy."""
    kvs = space.kv_u, space.kv_v
    knots, columns, domain = [np.array(kv.knots) for kv in kvs], [], None
    for level in range(len(refined) + 1):
        bases = [
            BSpline(t, np.eye(len(t) - kv.degree - 1), kv.degree)(x) for t, kv, x in zip(knots, kvs, (u, v))
        ]
        spans = [
            [support(t, kv.degree, i) for i in range(len(t) - kv.degree - 1)] for t, kv in zip(knots, kvs)
        ]
        for i, under_u in enumerate(spans[0]):
            for j, under_v in enumerate(spans[1]):
                if domain is None or all((a, b) in domain for a in under_u for b in under_v):
                    columns.append(0.5**level * bases[0][:, i] * bases[1][:, j])
        if level < len(refined):
            domain = {(2 * i + a, 2 * j + b) for i, j in refined[level] for a in (0, 1) for b in (0, 1)}
            knots = [bisected(t, kv.degree)[0] for t, kv in zip(knots, kvs)]
    return np.stack(columns, axis=1)


@examples(25)
@given(st.data())
def test_weights_are_those_of_scaled_b_splines(data):
    space, refined = data.draw(hierarchies(max_spans=3, deepest=2))
    u, v = data.draw(points(space))
    basis, columns = MultilevelBasis(space), generating_system(space, refined, u, v)
    assert basis.size == columns.shape[1] >= space.dim
    w = data.draw(seeds()).uniform(-1, 1, basis.size)
    p, q = space.kv_u.degree, space.kv_v.degree
    count = (5 * (p + q) + (p + 2) * (q + 2)) * (space.levels + 1) + basis.size
    assert (
        abs(THBSurface(space, basis.coefficients(w))(u, v) - columns @ w).max()
        <= float(gamma(4 * count)) * space.levels
    )


@examples(25)
@given(st.data())
def test_adjoint(data):
    space, _ = data.draw(hierarchies())
    basis, rng = MultilevelBasis(space), data.draw(seeds())
    w, g = rng.uniform(-1, 1, basis.size), rng.uniform(-1, 1, space.dim)
    back = basis.adjoint(g)
    assert back.shape == (basis.size,)
    assert (
        abs(basis.coefficients(w) @ g - w @ back)
        <= float(gamma(40 * space.levels + space.dim + basis.size)) * 2 * space.dim
    )


@examples(15)
@given(hierarchies(max_spans=3, deepest=2))
def test_it_spans_the_space(case):
    """M has full row rank, and weights of level 0 alone are prolonged."""
    space, _ = case
    basis = MultilevelBasis(space)
    m = np.stack([basis.coefficients(e) for e in np.eye(basis.size)], axis=1)
    assert np.linalg.matrix_rank(m) == space.dim
    start = THBSpace(space.kv_u, space.kv_v)
    assert m[:, : start.dim] == pytest.approx(start.prolongation(space).toarray(), abs=1e-14)


def test_a_tensor_product_space_is_its_own_system():
    kv = KnotVector.uniform(3, 4)
    basis = MultilevelBasis(THBSpace(kv, kv))
    w = np.arange(49.0)
    assert basis.size == 49
    assert (basis.coefficients(w) == w).all()
    assert (basis.adjoint(w) == w).all()


@examples(25)
@given(st.data())
def test_the_diagonal_of_a_quadratic_form_is_that_of_its_columns(data):
    """Of the sum of the squares of values at points."""
    space, refined = data.draw(hierarchies(max_spans=3, deepest=2))
    u, v = data.draw(points(space))
    columns = generating_system(space, refined, u, v)
    squares = [
        np.einsum("pi,pj->ij", *(kv.collocation(s).toarray() ** 2 for kv, s in zip(kvs, (u, v))))
        for kvs in map(space.embedding.knots, range(space.levels))
    ]
    found = MultilevelBasis(space).diagonal(squares)
    np.testing.assert_allclose(found, (columns**2).sum(axis=0), rtol=1e-10, atol=1e-14)
