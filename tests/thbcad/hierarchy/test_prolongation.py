"""Prolongation, embedding and restriction between spaces: what they keep, and what cannot be coarsened."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import BSpline

from oracles.spline_definitions import gamma
from tests.cases import examples
from tests.thbcad.cases import coefficients, hierarchies, knot_vectors, points, refined_spaces, spaces
from tests.thbcad.hierarchy.cases import ORDERS, block, entry_roundings, uniform_space
from thbcad.hierarchy.thb_space import THBSpace
from thbcad.splines import KnotVector


def refined_at_random(space, rng, levels):
    """Return the spaces of a random chain of refinements and the cells of every step."""
    chain, steps = [space], []
    for _ in range(levels):
        cells = chain[-1].cells
        chosen = cells[rng.random(len(cells)) < rng.uniform(0.2, 0.8)]
        marked = {int(level): chosen[chosen[:, 0] == level, 1:] for level in np.unique(chosen[:, 0])}
        steps.append(marked)
        chain.append(chain[-1].refine(marked))
    return chain, steps


@pytest.mark.slow
@given(
    knot_vectors(max_degree=5, max_spans=4),
    knot_vectors(max_degree=5, max_spans=4),
    st.integers(0, 2**32 - 1),
)
def test_restriction_is_a_left_inverse_of_prolongation(kv_u, kv_v, seed):
    """Q P = I for any two spaces of a chain, levels apart."""
    chain, _ = refined_at_random(THBSpace(kv_u, kv_v), np.random.default_rng(seed), 3)
    for coarse in range(3):
        for fine in range(coarse, 4):
            q = chain[fine].restriction(chain[coarse])
            p = chain[coarse].prolongation(chain[fine])
            assert q.shape == p.shape[::-1]
            assert abs((q @ p).toarray() - np.eye(chain[coarse].dim)).max() <= 1e-12


@pytest.mark.parametrize("degree", range(1, 6))
def test_restriction_after_one_uniform_refinement_keeps_13_digits(degree):
    kv = KnotVector.uniform(degree, 6)
    coarse = THBSpace(kv, kv)
    fine = coarse.refine({0: coarse.cells[:, 1:]})
    identity = (fine.restriction(coarse) @ coarse.prolongation(fine)).toarray()
    assert abs(identity - np.eye(coarse.dim)).max() <= 1e-13


def test_functions_of_both_spaces_keep_their_coefficients():
    kv = KnotVector.uniform(2, 8)
    coarse = THBSpace(kv, kv).refine({0: [(i, j) for i in range(4) for j in range(4)]})
    fine = coarse.refine({0: [(i, j) for i in range(5, 8) for j in range(5, 8)]})
    q = fine.restriction(coarse)
    names = {tuple(f): k for k, f in enumerate(fine.functions.tolist())}
    shared = [(row, names[tuple(f)]) for row, f in enumerate(coarse.functions.tolist()) if tuple(f) in names]
    assert len(shared) > 100
    for row, column in shared:
        entry = q[[row]].tocoo()
        assert entry.col.tolist() == [column]
        assert entry.data.tolist() == [1.0]


@given(st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_coarsen_undoes_refine(degree, seed):
    kv = KnotVector.uniform(degree, 4)
    chain, steps = refined_at_random(THBSpace(kv, kv), np.random.default_rng(seed), 3)
    for before, after, marked in zip(chain[-2::-1], chain[:0:-1], steps[::-1]):
        back = after.coarsen(marked)
        assert np.array_equal(back.cells, before.cells)
        assert np.array_equal(back.functions, before.functions)
        assert back.levels == before.levels


def test_what_cannot_be_coarsened_is_named():
    kv = KnotVector.uniform(2, 4)
    space = THBSpace(kv, kv).refine({0: [(0, 0), (1, 1)]}).refine({1: [(0, 1)]})
    with pytest.raises(ValueError, match=r"cell \(2, 2\) of level 0 is not refined"):
        space.coarsen({0: [(2, 2)]})
    with pytest.raises(ValueError, match=r"cell \(0, 0\) of level 0 has children that are refined"):
        space.coarsen({0: [(0, 0)]})
    with pytest.raises(ValueError, match=r"cell \(1, 1\) of level 2 is not refined"):
        space.coarsen({2: [(1, 1)]})
    assert space.coarsen({0: [(0, 0)], 1: [(0, 1)]}).levels == 2


@given(knot_vectors(max_degree=4, max_spans=4, scales=(1.0,)), st.integers(0, 2**32 - 1))
def test_extraction_gives_the_level_s_own_coefficients(kv, seed):
    """On every leaf cell scipy's B-spline of that level, on the full bisected knots, is the surface."""
    rng = np.random.default_rng(seed)
    chain, _ = refined_at_random(THBSpace(kv, kv), rng, 2)
    space = chain[-1]
    c = rng.normal(size=space.dim)
    p = kv.degree
    local = (space.extraction() @ c).reshape(len(space.cells), p + 1, p + 1)
    full = [kv, kv.bisect(), kv.bisect().bisect()]
    for (level, i, j), net in list(zip(space.cells.tolist(), local))[::7]:
        knots = full[level].knots
        breaks = full[level].breaks
        at = [breaks[k] + (breaks[k + 1] - breaks[k]) * np.array([0.1, 0.5, 0.9]) for k in (i, j)]
        last = [int(np.searchsorted(knots, breaks[k], "right")) - 1 for k in (i, j)]
        values = [
            np.stack(
                [
                    BSpline.basis_element(knots[m - p + a : m + a + 2], extrapolate=False)(x)
                    for a in range(p + 1)
                ]
            )
            for m, x in zip(last, at)
        ]
        there = np.nan_to_num(values[0]).T @ net @ np.nan_to_num(values[1])
        u, v = np.meshgrid(*at, indexing="ij")
        assert np.allclose(there, (space.collocation(u.ravel(), v.ravel()) @ c).reshape(3, 3), atol=1e-11)


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
