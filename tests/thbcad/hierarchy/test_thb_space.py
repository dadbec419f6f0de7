"""THB spaces against published oracles, the definition, and their invariants."""

import json
from dataclasses import FrozenInstanceError
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from oracles.spline_definitions import DefinitionTHB, gamma
from tests.cases import DATA
from tests.thbcad.cases import (
    coefficients,
    hierarchies,
    parameters,
    points,
    refined_spaces,
    spaces,
    tensor_spaces,
)
from thbcad.hierarchy.domains import MAX_LEVEL
from thbcad.hierarchy.levels import DyadicAxis
from thbcad.hierarchy.thb_space import THBSpace
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

EPS = np.finfo(float).eps
ANNULUS = json.loads((DATA / "thb_annulus.json").read_text())
RANDOM = json.loads((DATA / "thb_random.json").read_text())
NONUNIFORM = json.loads((DATA / "thb_nonuniform.json").read_text())
ORDERS = [(0, 0), (1, 0), (0, 1)]


def uniform_space(degree=3, spans=8, stop=1.0):
    kv = KnotVector.uniform(degree, spans, 0.0, stop)
    return THBSpace(kv, kv)


def block(i0, i1, j0, j1):
    return [(i, j) for i in range(i0, i1) for j in range(j0, j1)]


def refined_by(space, marked):
    for level, cells in enumerate(marked):
        space = space.refine({level: cells})
    return space


def oracle_coefficients(space):
    level, i, j = space.functions.T
    return np.sin(1.3 * i + 2.1 * j + 0.7 * level) + 0.3 * np.cos(0.37 * i * j + level)


def dof_per_level(space):
    return np.bincount(space.functions[:, 0], minlength=space.levels).tolist()


def entry_roundings(space):
    """Roundings in an entry of a prolongation or embedding: 5 per degree and direction, and the sums, for
    every level."""
    p, q = space.kv_u.degree, space.kv_v.degree
    return (5 * (p + q) + (p + 2) * (q + 2)) * space.levels


# ---- oracles on which independent codes agree ----


def test_annulus_counts_after_each_step():
    space = uniform_space(3, 7)
    assert (space.dim, dof_per_level(space)) == (100, [100])
    for level, cells in enumerate(ANNULUS["marked"]):
        space = space.refine({level: cells})
        assert space.dim == len(space.functions) == ANNULUS["dof_after_step"][level + 1]
        assert dof_per_level(space) == ANNULUS["dof_per_level_after_step"][level + 1]
    want = [(level, i, j) for level, pairs in enumerate(ANNULUS["active_functions"]) for i, j in pairs]
    assert [tuple(f) for f in space.functions.tolist()] == want


def test_annulus_values():
    space = refined_by(uniform_space(3, 7), ANNULUS["marked"])
    u, v = np.array(ANNULUS["points"]).T
    c = oracle_coefficients(space)
    for order, name, tolerance in zip(ORDERS, ("value", "dx", "dy"), (1e-12, 1e-9, 1e-9)):
        assert abs(space.collocation(u, v, order) @ c - ANNULUS[name]).max() <= tolerance


@pytest.mark.parametrize("case", RANDOM, ids=lambda c: f"seed{c['seed']}-degree{c['p']}-{c['mode']}")
def test_random_oracle(case):
    space = refined_by(uniform_space(case["p"], case["n0"], case["n0"]), case["marked"])
    assert space.dim == case["dof"]
    assert dof_per_level(space) == case["dof_per_level"]
    check_oracle_values(space, case)


@pytest.mark.parametrize("case", NONUNIFORM, ids=lambda c: f"seed{c['seed']}")
def test_nonuniform_oracle(case):
    kvs = (KnotVector(case["p"], case[name]) for name in ("knots_x", "knots_y"))
    space = refined_by(THBSpace(*kvs), case["marked"])
    assert space.dim == case["dof"]
    assert space.functions.tolist() == case["active"]
    check_oracle_values(space, case)


def check_oracle_values(space, case):
    """Relative to the largest value, as the oracles' README states."""
    u, v = np.array(case["points"]).T
    c = oracle_coefficients(space)
    surface = THBSurface(space, c)
    for order, name, tolerance in zip(ORDERS, ("value", "dx", "dy"), (1e-14, 1e-12, 1e-12)):
        want = np.array(case[name])
        assert abs(space.collocation(u, v, order) @ c - want).max() <= tolerance * abs(want).max()
        assert abs(surface(u, v, order) - want).max() <= tolerance * abs(want).max()


# ---- the truncated basis by its definition ----


@settings(max_examples=25)
@given(st.data())
def test_the_basis_is_the_truncated_one(data):
    """Functions, order, values and derivatives against level-by-level truncation with dense matrices."""
    space, refined = data.draw(hierarchies(max_spans=3, deepest=2))
    u, v = data.draw(points(space))
    twin = DefinitionTHB(space.kv_u, space.kv_v, refined)
    assert [tuple(f) for f in space.functions.tolist()] == twin.functions
    spans = [np.diff(kv.breaks).min() / 2 ** (space.levels - 1) for kv in (space.kv_u, space.kv_v)]
    # 4 roundings per inserted knot in the dense twin, 5 per degree in the evaluation of both
    roundings = 4 * sum(len(k) for k in twin.knots) + 10 * sum(twin.degrees) + entry_roundings(space)
    for order in [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0)]:
        scale = np.prod([(2 * p / h) ** r for p, h, r in zip(twin.degrees, spans, order)])
        error = abs(space.collocation(u, v, order).toarray() - twin.collocation(u, v, order)).max()
        assert error <= float(gamma(roundings)) * scale


def test_l_shaped_refinement_needs_two_dimensional_masks():
    """Errata 6: the functions dropped over an L are no product of one-dimensional sets."""
    space = uniform_space(2, 6, 6.0)
    cells = sorted(set(block(0, 6, 0, 3)) | set(block(0, 3, 0, 6)))
    finer = space.refine({0: cells})
    kept = {(i, j) for level, i, j in finer.functions.tolist() if level == 0}
    dropped = {(i, j) for i in range(8) for j in range(8)} - kept
    # supports of functions i <= 2 lie in columns 0..2: the union of two strips of 3 functions
    assert dropped == {(i, j) for i in range(8) for j in range(8) if i < 3 or j < 3}
    product = {(i, j) for i in {a for a, _ in dropped} for j in {b for _, b in dropped}}
    assert dropped < product
    # level 1: functions within the L: 14 x 14 of the square less those that need one of its 6 x 6 missing
    # cells
    assert dof_per_level(finer) == [64 - len(dropped), 14 * 14 - 8 * 8]
    twin = DefinitionTHB(space.kv_u, space.kv_v, [set(cells)])
    x = np.linspace(0, 6, 25)
    u, v = (a.ravel() for a in np.meshgrid(x, x))
    assert abs(finer.collocation(u, v).toarray() - twin.collocation(u, v)).max() <= 1e-14


def test_a_hole_and_two_islands():
    """A ring of refined cells and two regions that meet in a corner, by definition."""
    ring = set(block(0, 7, 0, 7)) - set(block(2, 5, 2, 5))
    islands = set(block(0, 4, 0, 4)) | set(block(4, 8, 4, 8))
    for cells in (ring, islands):
        space = uniform_space(2, 8, 8.0)
        twin = DefinitionTHB(space.kv_u, space.kv_v, [cells])
        space = space.refine({0: sorted(cells)})
        assert [tuple(f) for f in space.functions.tolist()] == twin.functions


# ---- invariants ----


@given(st.data())
def test_partition_of_unity_and_non_negative(data):
    space = data.draw(spaces())
    u, v = data.draw(points(space))
    a = space.collocation(u, v)
    assert a.shape == (len(u), space.dim)
    assert a.data.min() >= 0
    assert abs(a.sum(axis=1) - 1).max() <= float(gamma(2 * entry_roundings(space)))
    for order in [(1, 0), (0, 1)]:
        d = space.collocation(u, v, order)
        assert abs(d.sum(axis=1)).max() <= float(gamma(2 * entry_roundings(space))) * abs(d).sum(axis=1).max()


@settings(max_examples=25)
@given(spaces(max_spans=3))
def test_linear_independence(space):
    """The nets of the functions in the tensor-product form have full rank."""
    e = space.embedding.coefficients(np.eye(space.dim)).reshape(-1, space.dim)
    assert np.linalg.matrix_rank(e) == space.dim


@given(st.data())
def test_linear_functions_are_reproduced(data):
    """x y on the Greville grid of the tensor-product space lies in every THB space: prolong it from level
    0."""
    start = data.draw(tensor_spaces())
    space, _ = data.draw(refined_spaces((start, [])))
    u, v = data.draw(points(space))
    c = start.prolongation(space) @ np.outer(start.kv_u.greville(), start.kv_v.greville()).ravel()
    scale = abs(start.kv_u.knots).max() * abs(start.kv_v.knots).max()
    assert abs(space.collocation(u, v) @ c - u * v).max() <= float(gamma(3 * entry_roundings(space))) * scale


@given(hierarchies())
def test_cells_tile_the_domain(case):
    """Areas sum to the whole in exact arithmetic, and no cell occurs twice or has a refined descendant."""
    space, refined = case
    breaks = [[Fraction(float(b)) for b in kv.breaks] for kv in (space.kv_u, space.kv_v)]
    area = Fraction(0)
    for level, i, j in space.cells.tolist():
        sides = [(b[(k >> level) + 1] - b[k >> level]) / 2**level for b, k in zip(breaks, (i, j))]
        area += sides[0] * sides[1]
        assert level == len(refined) or (i, j) not in refined[level]
        assert level == 0 or (i // 2, j // 2) in refined[level - 1]
    assert area == (breaks[0][-1] - breaks[0][0]) * (breaks[1][-1] - breaks[1][0])
    cells = [tuple(c) for c in space.cells.tolist()]
    assert cells == sorted(set(cells))
    assert [set(map(tuple, r.tolist())) for r in space.refined] == refined
    assert space.levels == len(refined) + 1


@given(spaces())
def test_functions_are_ordered_by_level_i_j(space):
    functions = [tuple(f) for f in space.functions.tolist()]
    assert functions == sorted(set(functions))
    assert len(functions) == space.dim == space.collocation([space.kv_u.start], [space.kv_v.stop]).shape[1]


@given(st.data())
def test_locate_against_all_cells(data):
    """Points on breaks of every level and their float64 neighbours, in exact arithmetic."""
    space = data.draw(spaces())
    rows = []
    for kv in (space.kv_u, space.kv_v):
        axis, level = DyadicAxis(kv), data.draw(st.integers(0, space.levels))
        marks = data.draw(st.lists(st.integers(0, axis.spans(level)), min_size=4, max_size=4))
        x = axis.value(level, np.array(marks))
        sides = data.draw(st.lists(st.sampled_from([-np.inf, 0.0, np.inf]), min_size=4, max_size=4))
        x = np.array([a if s == 0 else np.nextafter(a, s) for a, s in zip(x, sides)])
        rows.append(np.clip(np.r_[x, data.draw(parameters(kv, 3))[:1]], kv.start, kv.stop))
    u, v = rows
    got = space.locate(u, v)
    for k, (a, b) in enumerate(zip(u, v)):
        inside = [
            n
            for n, (level, i, j) in enumerate(space.cells.tolist())
            if holds(space.kv_u, level, i, a) and holds(space.kv_v, level, j, b)
        ]
        assert inside == [got[k]]


def holds(kv, level, span, x):
    """Return whether a span of a level contains x; the end of the domain belongs to the last span."""
    breaks = [Fraction(float(b)) for b in kv.breaks]
    whole, part = divmod(span, 2**level)
    width = (breaks[whole + 1] - breaks[whole]) / 2**level
    low = breaks[whole] + part * width
    x = Fraction(float(x))
    return low <= x < low + width or x == low + width == breaks[-1]


# ---- prolongation ----


@settings(max_examples=30)
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


@settings(max_examples=30)
@given(st.data())
def test_prolongations_compose(data):
    first = data.draw(hierarchies(max_steps=2))
    second = data.draw(refined_spaces(first, 0, 3))
    third = data.draw(refined_spaces(second, 0, 3))
    a, b, c = first[0], second[0], third[0]
    error = abs(b.prolongation(c) @ a.prolongation(b) - a.prolongation(c)).max()
    assert error <= float(gamma(3 * entry_roundings(c)))


@settings(max_examples=20)
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


# ---- special hierarchies ----


def test_orphan_cells_hold_no_function():
    """A lone refined cell is too small for a new function: cells change, functions do not."""
    space = uniform_space(3, 8)
    finer = space.refine({0: [(3, 4)]})
    assert (finer.levels, finer.dim, len(finer.cells)) == (2, 121, 67)
    assert dof_per_level(finer) == [121, 0]
    assert (space.prolongation(finer).toarray() != 0).sum() == 121
    level, i, j = finer.cells[finer.locate([3.7 / 8], [4.2 / 8])[0]]
    assert (level, i, j) == (1, 7, 8)
    deeper = finer.refine({1: [(7, 8)]})
    assert (deeper.levels, deeper.dim) == (3, 121)
    assert deeper.refine({2: [(14, 16)]}).refine({0: block(0, 3, 0, 8)}).dim > 121


def test_repeats_are_harmless():
    space = uniform_space()
    once = space.refine({0: [(1, 2), (3, 4)]})
    often = space.refine({0: [(3, 4), (1, 2), (3, 4), (1, 2), (1, 2)]})
    assert (once.cells == often.cells).all()
    assert (once.refined[0] == often.refined[0]).all()


def test_the_order_of_refinement_does_not_matter():
    space = uniform_space()
    one = space.refine({0: block(0, 6, 0, 6)}).refine({1: block(0, 5, 0, 5)}).refine({0: [(7, 7)]})
    two = space.refine({0: [(7, 7), *block(0, 6, 0, 6)[::-1]]}).refine({1: block(0, 5, 0, 5)})
    assert (one.cells == two.cells).all()
    assert (one.functions == two.functions).all()


def test_several_levels_at_once():
    space = uniform_space().refine({0: block(0, 4, 0, 4)})
    both = space.refine({0: [(7, 7)], 1: [(0, 0)]})
    assert (both.cells == space.refine({1: [(0, 0)]}).refine({0: [(7, 7)]}).cells).all()


def test_numpy_cells_and_levels():
    space = uniform_space().refine({np.int32(0): np.array([[1, 2], [3, 4]], dtype=np.int16)})
    assert space.refined[0].tolist() == [[1, 2], [3, 4]]


def test_refining_nothing_changes_nothing():
    space = uniform_space()
    assert space.refine({}).dim == space.refine({0: [], 5: []}).dim == space.dim
    assert space.refine({0: []}).levels == 1


@settings(max_examples=20)
@given(st.data())
def test_mirror_symmetry(data):
    """The mirrored refinement of a mirrored knot vector has the mirrored functions and values."""
    space, refined = data.draw(hierarchies(max_spans=3))
    kv = space.kv_u
    mirror = KnotVector(kv.degree, -kv.knots[::-1])
    other = refined_by(
        THBSpace(mirror, space.kv_v),
        [[((kv.spans << level) - 1 - i, j) for i, j in cells] for level, cells in enumerate(refined)],
    )
    counts = [len(axis_functions(kv, level)) for level in range(space.levels)]
    image = [(level, counts[level] - 1 - i, j) for level, i, j in space.functions.tolist()]
    order = sorted(range(space.dim), key=lambda k: image[k])
    assert [image[k] for k in order] == [tuple(f) for f in other.functions.tolist()]
    u, v = data.draw(points(space))
    inside = ~np.isin(u, np.r_[kv.breaks])
    a, b = (
        space.collocation(u[inside], v[inside]).toarray(),
        other.collocation(-u[inside], v[inside]).toarray(),
    )
    assert abs(a[:, order] - b).max(initial=0) <= float(gamma(4 * entry_roundings(space)))


def axis_functions(kv, level):
    for _ in range(level):
        kv = kv.bisect()
    return range(kv.dim)


@settings(max_examples=20)
@given(hierarchies(max_spans=3))
def test_transposition(case):
    """Swapping x and y swaps the indices of the functions."""
    space, refined = case
    other = refined_by(THBSpace(space.kv_v, space.kv_u), [[(j, i) for i, j in cells] for cells in refined])
    assert sorted((level, j, i) for level, i, j in space.functions.tolist()) == [
        tuple(f) for f in other.functions.tolist()
    ]


def corner(space, depth, right, top, width=4):
    """Refine a square of cells in a corner of the domain, level by level."""
    for level in range(depth):
        n_u, n_v = (kv.spans << level for kv in (space.kv_u, space.kv_v))
        i, j = (n_u - width if right else 0), (n_v - width if top else 0)
        space = space.refine({level: block(i, i + width, j, j + width)})
    return space


@pytest.mark.parametrize("right", [False, True])
@pytest.mark.parametrize("top", [False, True])
def test_deep_corner(right, top):
    """4 x 4 corner cells of 8 x 8, degree 3, to level 20: 121 functions and 48 more for every level."""
    space = corner(uniform_space(3, 8), 20, right, top)
    assert (space.levels, space.dim, len(space.cells)) == (21, 1081, 64 + 20 * 48)
    assert space.embedding.shape(20) == (11 + 20 * 4, 11 + 20 * 4)
    tip = [float(right)], [float(top)]
    assert space.cells[space.locate(*tip)[0]].tolist() == [
        20,
        *((8 << 20) - 1 if far else 0 for far in (right, top)),
    ]
    x = np.concatenate([[0.0, 1.0], 0.5 ** np.arange(1, 26), 1 - 0.5 ** np.arange(1, 26)])
    u, v = (a.ravel() for a in np.meshgrid(x, x))
    a = space.collocation(u, v)
    assert a.data.min() >= 0
    assert abs(a.sum(axis=1) - 1).max() <= float(gamma(2 * entry_roundings(space)))
    shallow = corner(uniform_space(3, 8), 3, right, top)
    p = shallow.prolongation(space)
    assert abs(a @ p - shallow.collocation(u, v)).max() <= float(gamma(4 * entry_roundings(space)))


@pytest.mark.parametrize("right", [False, True])
def test_the_deepest_corner(right):
    """The last level that `refine` admits, in the corners with the least and the largest cell numbers."""
    space = corner(uniform_space(3, 8), MAX_LEVEL, right, right)
    assert space.levels == MAX_LEVEL + 1
    assert space.dim == 121 + MAX_LEVEL * 48
    assert space.cells[space.locate([float(right)], [float(right)])[0], 0] == MAX_LEVEL


def test_two_far_corners_cost_no_full_grid():
    """Windows at both ends of level 12: the tensor-product form holds their knots only."""
    space = uniform_space(2, 4)
    for level in range(12):
        n = 4 << level
        space = space.refine({level: block(0, 2, 0, 2) + block(n - 2, n, n - 2, n)})
    assert space.embedding.kv_u.spans == 4 + 12 * 4
    assert space.collocation([0.0, 0.5, 1.0], [0.0, 0.5, 1.0]).sum(axis=1).tolist() == pytest.approx(
        [1, 1, 1], abs=1e-13
    )


def test_spans_too_short_for_float64_are_refused():
    space = THBSpace(KnotVector.uniform(1, 1, 1.0, 1.0 + 2.0**-50), KnotVector.uniform(1, 1))
    with pytest.raises(ValueError, match="too deep: neighbouring knots coincide in float64"):
        _ = refined_by(space, [block(0, 1 << level, 0, 1 << level) for level in range(4)]).embedding


# ---- objects and errors ----


def test_refine_returns_new_objects():
    space = uniform_space()
    before = space.dim, space.cells.copy(), space.functions.copy()
    finer = space.refine({0: block(0, 4, 0, 4)})
    assert finer is not space
    assert space.refine({}) is not space
    assert (space.dim, space.levels) == (before[0], 1)
    assert (space.cells == before[1]).all()
    assert (space.functions == before[2]).all()


def test_arrays_are_read_only():
    space = uniform_space().refine({0: block(0, 4, 0, 4)})
    levels = [
        a
        for k in space.hierarchy
        for a in (k.cells, k.refined, k.leaves, k.keys, k.functions, k.active, k.supported, *k.distinct)
    ]
    nets = [
        *space.nets.active,
        *(step.data for step in space.nets.steps),
        space.nets.operator.data,
        space.local_basis.blocks,
    ]
    embedding = [space.embedding.kv_u.knots, *space.embedding.active, *space.embedding.supported]
    for array in (space.cells, space.functions, space.boxes, space.refined[0], *levels, *nets, *embedding):
        assert not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0


def test_spaces_are_frozen():
    with pytest.raises(FrozenInstanceError):
        uniform_space().kv_u = KnotVector.uniform(2, 3)


@pytest.mark.parametrize("arguments", [(1, None), (KnotVector.uniform(2, 3), [0, 1])])
def test_spaces_need_knot_vectors(arguments):
    with pytest.raises(ValueError, match=r"kv_[uv] must be a KnotVector, got (int|list)"):
        THBSpace(*arguments)


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ({0: [(0, 0), (8, 0)]}, r"cell \(8, 0\) lies outside level 0, which has 8 x 8 cells"),
        ({0: [(0, 8)]}, r"cell \(0, 8\) lies outside level 0"),
        ({0: [(-1, 0)]}, r"cell \(-1, 0\) lies outside level 0"),
        ({1: [(16, 0)]}, r"cell \(16, 0\) lies outside level 1, which has 16 x 16 cells"),
        ({0: [(7, 7), (1, 2)]}, r"cell \(1, 2\) of level 0 is refined already"),
        ({1: [(2, 4), (0, 0)]}, r"cell \(0, 0\) of level 1 does not exist: its parent is not refined"),
        ({2: [(8, 16)]}, r"cell \(8, 16\) of level 2 does not exist: its parent is not refined"),
        ({0: [(0, 0)], 1: [(0, 0)]}, r"cell \(0, 0\) of level 1 does not exist"),
        ({-1: [(0, 0)]}, "level must be an integer from 0 to [0-9]+, got -1"),
        ({MAX_LEVEL: [(0, 0)]}, f"level must be an integer from 0 to {MAX_LEVEL - 1}, got {MAX_LEVEL}"),
        ({True: [(0, 0)]}, "level must be an integer from 0 to [0-9]+, got True"),
        ({0.0: [(0, 0)]}, "level must be an integer"),
        ({"0": [(0, 0)]}, "level must be an integer from 0 to [0-9]+, got '0'"),
        (
            {0: [(0.5, 0)]},
            r"cells of level 0 must be pairs \(i, j\) of integers, got float64 of shape \(1, 2\)",
        ),
        ({0: [(0.0, 1.0)]}, "must be pairs .* got float64"),
        ({0: [(True, False)]}, "must be pairs .* got bool"),
        ({0: (0, 1)}, r"must be pairs .* of shape \(2,\)"),
        ({0: [(0, 0, 0)]}, r"must be pairs .* of shape \(1, 3\)"),
        ({0: [(np.nan, 0)]}, "must be pairs"),
        ({0: "ab"}, "must be pairs"),
        ({0: np.array([(2**63, 0)], dtype=np.uint64)}, "pairs .* below 2.63, got 9223372036854775808"),
        ([(0, 0)], r"cells must be a mapping \{level: .*\}, got list"),
        (None, "cells must be a mapping .*, got NoneType"),
    ],
)
def test_cells_are_refused(cells, message):
    space = uniform_space().refine({0: [(1, 2)]})
    with pytest.raises(ValueError, match=message):
        space.refine(cells)


def test_other_spaces_are_refused():
    space = uniform_space().refine({0: [(1, 2)]})
    space = space.refine({0: [(3, 3)]})
    for other in (
        uniform_space(),
        uniform_space().refine({0: [(2, 1)]}),
        uniform_space().refine({0: [(1, 2), (4, 4)]}),
    ):
        with pytest.raises(ValueError, match="not a refinement of this one"):
            space.prolongation(other)
    for other in (uniform_space(2), uniform_space(3, 4), uniform_space(3, 8, 2.0), 5):
        with pytest.raises(ValueError, match="must be a THBSpace over the same two knot vectors"):
            space.prolongation(other)


@pytest.mark.parametrize(
    ("u", "v", "message"),
    [
        ([0.1, 0.2], [0.1], r"two rows of equal length, got shapes \(2,\) and \(1,\)"),
        ([[0.1]], [[0.1]], "two rows of equal length"),
        ([1.1], [0.5], r"parameter 1\.1 lies outside the domain"),
        ([0.5], [np.nan], "parameter nan lies outside the domain"),
    ],
)
def test_points_are_refused(u, v, message):
    for method in (uniform_space().collocation, uniform_space().locate):
        with pytest.raises(ValueError, match=message):
            method(u, v)


def test_derivative_orders_are_refused():
    with pytest.raises(ValueError, match="derivative must be a non-negative integer, got -1"):
        uniform_space().collocation([0.5], [0.5], (0, -1))
