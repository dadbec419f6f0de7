"""THB spaces: the truncated basis by its definition, its invariants, and what is refused."""

from dataclasses import FrozenInstanceError
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st

from oracles.spline_definitions import DefinitionTHB, gamma
from tests.cases import examples
from tests.thbcad.cases import hierarchies, parameters, points, refined_spaces, spaces, tensor_spaces
from tests.thbcad.hierarchy.cases import block, dof_per_level, entry_roundings, uniform_space
from thbcad.hierarchy.domains import MAX_LEVEL
from thbcad.hierarchy.levels import DyadicAxis
from thbcad.splines import KnotVector

# ---- the truncated basis by its definition ----


@examples(25)
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


@examples(25)
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


@examples(25)
@given(st.data(), st.integers(0, 3))
def test_uniform_cuts_what_is_coarser_and_leaves_what_is_finer(data, level):
    space, _ = data.draw(hierarchies(max_spans=3, deepest=2))
    finer = space.uniform(level)
    kept = {tuple(cell) for cell in space.cells.tolist() if cell[0] >= level}
    cells = {tuple(cell) for cell in finer.cells.tolist()}
    assert kept <= cells
    assert {cell[0] for cell in cells - kept} <= {level}
    coefficients = np.arange(space.dim) % 7.0
    u, v = data.draw(points(space))
    values = [
        s.collocation(u, v) @ c
        for s, c in ((space, coefficients), (finer, space.prolongation(finer) @ coefficients))
    ]
    assert values[1] == pytest.approx(values[0], abs=1e-12)


def test_a_level_that_cannot_be_is_refused():
    for level in (-1, 1.5, MAX_LEVEL + 1):
        with pytest.raises((ValueError, TypeError), match="level must be"):
            uniform_space().uniform(level)


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
        ([(0, 0)], r"mapping \{level: .*\} or rows \[level, i, j\] .* got list of shape \(1, 2\)"),
        (None, "cells must be a mapping .*, got NoneType"),
        ([[0.0, 0.0, 0.0]], "got list of shape .* and type float64"),
        ([[0, 0, 0], [0, 1, 2]], r"cell \(1, 2\) of level 0 is refined already"),
        ([True] * 66, r"mask must hold a bool for each of the 67 leaf cells, got shape \(66,\)"),
    ],
)
def test_cells_are_refused(cells, message):
    space = uniform_space().refine({0: [(1, 2)]})
    with pytest.raises(ValueError, match=message):
        space.refine(cells)


@pytest.mark.parametrize(
    ("u", "v", "message"),
    [
        ([0.1, 0.2], [0.1, 0.2, 0.3], r"must have shapes that broadcast, got \(2,\) and \(3,\)"),
        ([[0.1]], [[0.1]], r"u and v must be rows of points, got shape \(1, 1\)"),
        ([1.1], [0.5], r"u = 1\.1 lies outside the domain"),
        ([0.5], [np.nan], "v = nan lies outside the domain"),
    ],
)
def test_points_are_refused(u, v, message):
    for method in (uniform_space().collocation, uniform_space().locate):
        with pytest.raises(ValueError, match=message):
            method(u, v)
