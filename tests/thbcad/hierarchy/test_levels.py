"""The integer bookkeeping of dyadic refinement against explicit knot vectors and loops over cells."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.thbcad.cases import hierarchies, knot_vectors
from thbcad.hierarchy.levels import DyadicAxis
from thbcad.hierarchy.thb_space import THBSpace
from thbcad.splines import KnotVector


def bisected(kv, level):
    for _ in range(level):
        kv = kv.bisect()
    return kv


@given(knot_vectors(scales=(1.0,), max_spans=4), st.integers(0, 4))
def test_dyadic_axis_against_explicit_bisection(kv, level):
    axis = DyadicAxis(kv)
    fine = kv
    for _ in range(level):
        fine = fine.bisect()
    assert axis.spans(level) == fine.spans
    k = np.arange(fine.spans + 1)
    values, first, counts = np.unique(fine.knots, return_index=True, return_counts=True)
    assert (axis.value(level, k) == values).all()
    assert (axis.first_knot(level, k) == first).all()
    assert (axis.multiplicity(level, k) == counts).all()
    new = k[counts == 1] if level else k[:0]
    old = np.unique(kv.knots)
    new = np.array([b for b in new if values[b] not in old], dtype=np.int64)
    assert (axis.knots_with(level, new)[0].knots == fine.knots).all()
    index = np.arange(len(fine.knots))
    assert (axis.knots(level, index) == fine.knots).all()
    assert (values[axis.knot_break(level, index)] == fine.knots).all()


@given(knot_vectors(), st.integers(0, 20))
def test_old_breaks_keep_their_bits_at_every_level(kv, level):
    """Where a + (b - a) is not b, too."""
    assert (DyadicAxis(kv).value(level, np.arange(kv.spans + 1) << level) == kv.breaks).all()


def test_the_end_keeps_its_bits():
    """Where a + (b - a) is not b."""
    a, b = 0.1 * -9, 0.1 * -2
    assert a + (b - a) != b
    axis = DyadicAxis(KnotVector(1, [a, a, b, b]))
    assert axis.value(3, np.array([0, 8])).tolist() == [a, b]
    assert THBSpace(axis.knot_vector, axis.knot_vector).refine({0: [(0, 0)]}).embedding.kv_u.stop == b


@given(knot_vectors(scales=(1.0,), max_spans=4), st.integers(0, 3))
def test_acting_functions_and_their_supports(kv, level):
    axis, fine = DyadicAxis(kv), bisected(kv, level)
    spans, functions = np.arange(fine.spans), np.arange(fine.dim)
    first, _ = fine.basis(fine.breaks[:-1])
    assert (axis.acting(level, spans) == first).all()
    head, tail = axis.support(level, functions)
    assert (fine.breaks[head] == fine.knots[functions]).all()
    assert (fine.breaks[tail] == fine.knots[functions + fine.degree + 1]).all()
    for span, knots in zip(spans, axis.knots_around(level, spans).T):
        assert (knots == fine.knots[first[span] + 1 : first[span] + 2 * fine.degree + 1]).all()


@given(knot_vectors(scales=(1.0,), max_spans=4), st.integers(1, 3))
def test_two_scale_relation_is_knot_insertion(kv, level):
    """Every entry that is not zero is held; those held are equal to the last bit."""
    axis, coarse = DyadicAxis(kv), bisected(kv, level - 1)
    fine = coarse.bisect()
    found = axis.two_scale(level, np.arange(fine.dim), np.arange(coarse.dim))
    want = coarse.prolongation(fine).toarray()
    assert (found.toarray() == np.where(found.toarray() > 0, want, 0)).all()
    assert (abs(want[found.toarray() == 0]) <= 1e-15).all()
    assert found.data.min() > 0


@pytest.mark.parametrize("spans", [3, 7, 10])
def test_locate_agrees_with_the_knots_where_breaks_are_rounded(spans):
    """Breaks k/7 at level 20: the knots of the exact tensor-product form decide."""
    level = 20
    axis = DyadicAxis(KnotVector.uniform(3, spans))
    k = np.arange(spans << level, step=9973)
    x = axis.value(level, k)
    assert (axis.span_at(level, x) == k).all()
    assert (axis.span_at(level, np.nextafter(x[1:], 0)) == k[1:] - 1).all()
    assert axis.span_at(level, np.array([1.0])).tolist() == [(spans << level) - 1]


@given(hierarchies())
def test_levels_by_definition(case):
    """Which functions act on Omega_l, are supported in it and are active, cell by cell."""
    space, refined = case
    for level in space.hierarchy:
        cells = set(map(tuple, level.cells.tolist()))
        deeper = refined[level.number] if level.number < len(refined) else set()
        assert set(map(tuple, level.cells[level.refined].tolist())) == deeper
        supports = [
            np.stack(axis.support(level.number, np.arange(bisected(axis.knot_vector, level.number).dim)), 1)
            for axis in level.axes
        ]
        rows = []
        for i, (a, b) in enumerate(supports[0].tolist()):
            for j, (c, d) in enumerate(supports[1].tolist()):
                under = {(k, m) for k in range(a, b) for m in range(c, d)}
                if under & cells:
                    rows.append((i, j, under <= cells, under <= cells and not under <= deeper))
        assert np.column_stack([level.functions, level.supported, level.active]).tolist() == [
            list(map(int, row)) for row in rows
        ]


@given(hierarchies())
def test_blocks_hold_the_functions_of_a_cell(case):
    space, _ = case
    for level in space.hierarchy:
        blocks = level.functions[level.blocks(level.cells)]
        for d, axis in enumerate(level.axes):
            first = axis.acting(level.number, level.cells[:, d])
            offsets = np.indices(blocks.shape[1:3])[d]
            assert (blocks[..., d] == first[:, None, None] + offsets).all()


@given(hierarchies())
def test_functions_that_do_not_act_are_not_found(case):
    space, _ = case
    top = space.hierarchy[-1]
    shape = [bisected(axis.knot_vector, top.number).dim for axis in top.axes]
    everything = np.stack(np.indices(shape), axis=-1)
    at = top.find(everything)
    assert (np.sort(at[at >= 0]) == np.arange(len(top.keys))).all()
    assert (top.functions[at[at >= 0]] == everything[at >= 0]).all()
