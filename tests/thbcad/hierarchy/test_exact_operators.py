"""Prolongation between THB spaces and their embedding in tensor-product splines, which keep the spline."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from oracles.spline_definitions import gamma
from tests.cases import examples
from tests.thbcad.cases import coefficients, hierarchies, points, refined_spaces, spaces
from tests.thbcad.hierarchy.cases import ORDERS, block, entry_roundings, uniform_space
from thbcad.hierarchy.thb_space import THBSpace
from thbcad.splines import KnotVector

# ---- prolongation ----


@examples(30)
@given(st.data())
def test_prolongation_keeps_the_spline(data):
    start = data.draw(hierarchies(max_steps=3))
    finer, _ = data.draw(refined_spaces(start))
    space = start[0]
    u, v = data.draw(points(space))
    p = space.prolongation(finer)
    assert p.shape == (finer.dim, space.dim)
    assert p.data.min() >= 0
    assert abs(p.sum(axis=1) - 1).max() <= float(gamma(2 * entry_roundings(finer)))
    for order in ORDERS:
        want = space.collocation(u, v, order)
        error = abs(finer.collocation(u, v, order) @ p - want).max()
        spans = [np.diff(kv.breaks).min() / 2 ** (finer.levels - 1) for kv in (space.kv_u, space.kv_v)]
        scale = np.prod(
            [(2 * kv.degree / h) ** r for kv, h, r in zip((space.kv_u, space.kv_v), spans, order)]
        )
        assert error <= float(gamma(4 * entry_roundings(finer))) * scale


@examples(30)
@given(st.data())
def test_prolongations_compose(data):
    first = data.draw(hierarchies(max_steps=2))
    second = data.draw(refined_spaces(first, 0, 3))
    third = data.draw(refined_spaces(second, 0, 3))
    a, b, c = first[0], second[0], third[0]
    error = abs(b.prolongation(c) @ a.prolongation(b) - a.prolongation(c)).max()
    assert error <= float(gamma(3 * entry_roundings(c)))


@examples(20)
@given(spaces())
def test_prolongation_to_the_same_space_is_the_identity(space):
    p = space.prolongation(space).toarray()
    assert (p[~np.eye(space.dim, dtype=bool)] == 0).all()
    assert abs(np.diag(p) - 1).max() <= float(gamma(entry_roundings(space)))


def test_prolongation_to_a_uniform_refinement_is_the_tensor_product():
    space = uniform_space(3, 5)
    finer = space.refine({0: block(0, 5, 0, 5)})
    step = space.kv_u.prolongation(space.kv_u.bisect()).toarray()
    assert finer.dim == 13 * 13
    assert abs(space.prolongation(finer).toarray() - np.kron(step, step)).max() <= float(
        gamma(2 * entry_roundings(finer))
    )


# ---- embedding ----


@given(st.data())
def test_embedding_operator_coefficients_and_adjoint_agree(data):
    space = data.draw(spaces())
    e = space.embedding
    c = data.draw(coefficients(space.dim))
    g = data.draw(coefficients(e.kv_u.dim, e.kv_v.dim))
    net, back, operator = (
        e.coefficients(c),
        e.adjoint(g),
        e.coefficients(np.eye(space.dim)).reshape(-1, space.dim),
    )
    tolerance = float(gamma(2 * entry_roundings(space)))
    assert abs(net.ravel() - operator @ c).max() <= tolerance
    size = (abs(operator).T @ abs(g.ravel())).max()
    assert abs(back - operator.T @ g.ravel()).max() <= (tolerance + float(gamma(g.size))) * size
    assert abs((net * g).sum() - c @ back) <= (tolerance + float(gamma(g.size + space.dim))) * abs(g).sum()
    assert operator.min() >= 0


@given(st.data())
def test_embedding_of_vectors_is_columnwise(data):
    space = data.draw(spaces())
    c = data.draw(coefficients(space.dim, 3))
    net = space.embedding.coefficients(c)
    for d in range(3):
        assert (net[..., d] == space.embedding.coefficients(c[:, d])).all()


@pytest.mark.parametrize("shape", [(48,), (50,), (49, 2, 2), ()])
def test_embedding_refuses_other_shapes(shape):
    with pytest.raises(ValueError, match=r"coefficients must have shape \(49,\) or \(49, d\), got"):
        uniform_space(3, 4).embedding.coefficients(np.zeros(shape))


def test_the_embedding_holds_only_needed_knots():
    space = uniform_space(3, 8, 8.0).refine({0: block(0, 4, 4, 8)}).refine({1: block(0, 4, 12, 16)})
    assert space.embedding.kv_u.breaks.tolist() == [
        0,
        0.25,
        0.5,
        0.75,
        1,
        1.25,
        1.5,
        1.75,
        2,
        2.5,
        3,
        3.5,
        4,
        5,
        6,
        7,
        8,
    ]
    assert (space.embedding.kv_v.breaks == 8 - space.embedding.kv_u.breaks[::-1]).all()


def test_insertions_do_not_disturb_the_hierarchy_above_them():
    """A space over inserted knots equals the coarse one where both hold the same splines."""
    kv = KnotVector.uniform(2, 3)
    fine = kv.insert([0.25])
    coarse, finer = THBSpace(kv, kv), THBSpace(fine, fine)
    c = np.arange(coarse.dim) % 5 - 1.5
    step = kv.prolongation(fine).toarray()
    x = np.linspace(0, 1, 7)
    assert np.allclose(
        finer.collocation(x, x) @ (np.kron(step, step) @ c), coarse.collocation(x, x) @ c, rtol=0, atol=1e-14
    )
