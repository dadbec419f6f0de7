"""Identities that tie the operators together: order does not matter, maps of the parameters do not matter,
powers are held."""

from math import comb

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from oracles.spline_definitions import gamma
from tests.cases import examples
from tests.thbcad.cases import (
    coefficients,
    hierarchies,
    insertions,
    knot_vectors,
    parameters,
    points,
    seeds,
    spaces,
)
from thbcad import BSplineSurface, KnotVector, THBSpace, THBSurface, quasi_interpolate

TIGHT = 1e-13  # polar forms: a few roundings per degree on numbers up to 1


def mapped(kv, scale, shift):
    return KnotVector(kv.degree, scale * kv.knots + shift)


@given(knot_vectors(scales=(1.0,)), st.sampled_from([(2.0, 0.0), (0.25, 3.0), (1024.0, -512.0)]), st.data())
def test_functions_do_not_depend_on_affine_maps(kv, affine, data):
    """Scales by powers of two and shifts by small whole numbers keep every knot exact: equal to the last
    bits; derivatives scale."""
    scale, shift = affine
    u = data.draw(parameters(kv))
    u = np.round(u * 64) / 64  # exact under the map, too
    u = np.clip(u, kv.start, kv.stop)
    other = mapped(kv, scale, shift)
    for order in range(min(kv.degree, 3) + 1):
        a, b = (
            kv.collocation(u, order).toarray(),
            other.collocation(scale * u + shift, order).toarray() * scale**order,
        )
        assert np.allclose(a, b, rtol=1e-12, atol=TIGHT * np.abs(a).max(initial=1))


@given(hierarchies(), st.sampled_from([(2.0, 0.0), (0.5, 8.0)]), st.data())
def test_hierarchies_do_not_depend_on_affine_maps(case, affine, data):
    space, refined = case
    scale, shift = affine
    other = THBSpace(mapped(space.kv_u, scale, shift), mapped(space.kv_v, scale, shift))
    for level, cells in enumerate(refined):
        other = other.refine({level: sorted(cells)})
    assert (other.functions == space.functions).all()
    assert abs(other.extraction() - space.extraction()).max() <= TIGHT
    u, v = data.draw(points(space))
    inside = [np.clip(scale * x + shift, kv.start, kv.stop) for x, kv in ((u, other.kv_u), (v, other.kv_v))]
    c = data.draw(coefficients(space.dim))
    assert np.allclose(THBSurface(other, c)(*inside), THBSurface(space, c)(u, v), rtol=0, atol=1e-11)


@given(knot_vectors(max_degree=5), knot_vectors(max_degree=5), st.data())
def test_insertions_in_u_and_in_v_commute(kv_u, kv_v, data):
    surface = BSplineSurface(kv_u, kv_v, data.draw(coefficients(kv_u.dim, kv_v.dim)))
    a, b = data.draw(insertions(kv_u)), data.draw(insertions(kv_v))
    one, other = surface.insert(a).insert((), b), surface.insert((), b).insert(a)
    assert np.allclose(one.coefficients, other.coefficients, rtol=0, atol=TIGHT)
    assert np.allclose(one.coefficients, surface.insert(a, b).coefficients, rtol=0, atol=TIGHT)


@given(knot_vectors(max_degree=9), st.data())
def test_insertion_and_elevation_commute(kv, data):
    """Elevated knots carry one copy more of each new knot."""
    new = data.draw(insertions(kv, size=3))
    finer = kv.insert(new)
    fresh = [x for x in np.unique(new) if x not in kv.breaks]
    one = finer.elevation() @ kv.prolongation(finer)
    high = kv.elevate()
    other = high.prolongation(high.insert([*new, *fresh])) @ kv.elevation()
    assert abs(one - other).max() <= TIGHT


@given(knot_vectors(max_degree=6), st.data())
def test_segments_of_segments_are_segments(kv, data):
    shares = sorted(data.draw(st.sets(st.integers(0, 64), min_size=4, max_size=4)))
    a, b, c, d = (kv.start + (kv.stop - kv.start) * s / 64 for s in shares)
    assume(d <= kv.stop)
    outer, to_outer = kv.segment(a, d)
    inner, to_inner = outer.segment(b, c)
    direct, operator = kv.segment(b, c)
    assert (inner.knots == direct.knots).all()
    assert abs(to_inner @ to_outer - operator).max() <= TIGHT


@examples(30)
@given(spaces(max_spans=4), seeds())
def test_coarsening_in_any_order_ends_in_the_same_space(space, rng):
    """Two disjoint sets of leaves, refined and made whole in both orders."""
    leaves = space.cells[space.cells[:, 0] < 3]
    assume(len(leaves) >= 2)
    chosen = rng.permutation(len(leaves))[:6]
    parts = [
        {int(level): [cell[1:] for cell in part if cell[0] == level] for level in np.unique(part[:, 0])}
        for part in (leaves[chosen[::2]], leaves[chosen[1::2]])
    ]
    a, b = parts
    both = space.refine(a).refine(b)
    assert (both.cells == space.refine(b).refine(a).cells).all()
    assert (both.coarsen(a).cells == space.refine(b).cells).all()
    assert (both.coarsen(b).coarsen(a).cells == space.cells).all()
    p = space.prolongation(both)
    for middle in (space.refine(a), space.refine(b)):
        assert abs(middle.prolongation(both) @ space.prolongation(middle) - p).max() <= TIGHT


@given(spaces(max_degree=4))
def test_refinement_and_conversion_commute(space):
    c = np.cos(np.arange(space.dim))
    finer = space.refine({int(space.cells[-1, 0]): [space.cells[-1, 1:]]})
    moved = THBSurface(finer, space.prolongation(finer) @ c).to_bspline()
    direct = THBSurface(space, c).to_bspline()
    lifted = direct.kv_u.prolongation(moved.kv_u), direct.kv_v.prolongation(moved.kv_v)
    assert np.allclose(lifted[0] @ direct.coefficients @ lifted[1].T, moved.coefficients, rtol=0, atol=TIGHT)


@examples(30)
@given(spaces(max_degree=4, max_spans=4), st.data())
def test_powers_up_to_the_degree_are_in_the_space(space, data):
    """x^a y^b in [-1, 1]^2; what the projector loses is its norm times the roundings of a value."""
    a, b = (data.draw(st.integers(0, kv.degree)) for kv in (space.kv_u, space.kv_v))

    def power(u, v):
        s, t = (2 * (x - kv.start) / (kv.stop - kv.start) - 1 for x, kv in ((u, space.kv_u), (v, space.kv_v)))
        return s**a * t**b

    surface = quasi_interpolate(space, power)
    u, v = data.draw(points(space))
    assert np.allclose(surface(u, v), power(u, v), rtol=0, atol=1e-9)


@given(knot_vectors(scales=(1.0,)))
def test_marsden_identity(kv):
    """The coefficients of u^r are mean products of r of the p inner knots; here r = p: the product of all."""
    p = kv.degree
    centre, half = (kv.start + kv.stop) / 2, (kv.stop - kv.start) / 2
    inner = np.stack([kv.knots[k : k + kv.dim] for k in range(1, p + 1)])
    c = np.prod((inner - centre) / half, axis=0)
    u = np.linspace(kv.start, kv.stop, 17)
    assert np.allclose(kv.collocation(u) @ c, ((u - centre) / half) ** p, rtol=0, atol=float(gamma(20 * p)))


@pytest.mark.parametrize("degree", range(1, 11))
def test_binomial_rows_of_uniform_two_scale_relations(degree):
    """Far from the ends a uniform B-spline splits with the weights C(p + 1, k) / 2^p, as Lane and Riesenfeld
    found."""
    kv = KnotVector.uniform(degree, 4 * degree + 4)
    finer = kv.bisect()
    column = kv.prolongation(finer).toarray()[:, kv.dim // 2]
    wanted = [comb(degree + 1, k) / 2**degree for k in range(degree + 2)]
    assert np.allclose(column[column > 0], wanted, rtol=1e-13, atol=0)
