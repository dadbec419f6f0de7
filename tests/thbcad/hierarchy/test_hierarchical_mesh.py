"""Meshes of nested cells: the ways to name cells, boxes, common refinements, quadrature, Greville points."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from oracles.spline_definitions import DefinitionTHB, gamma
from tests.cases import examples
from tests.thbcad.cases import hierarchies, points, refined_spaces, seeds, spaces, tensor_spaces
from tests.thbcad.hierarchy.cases import block, entry_roundings, uniform_space
from thbcad.hierarchy.domains import MAX_LEVEL
from thbcad.hierarchy.hierarchical_mesh import common_refinement
from thbcad.hierarchy.thb_space import THBSpace
from thbcad.splines import KnotVector

FOUR = [(0, 0), (0, 1), (1, 0), (1, 1)]  # children


def cells_of(space):
    return {tuple(cell) for cell in space.cells.tolist()}


# ---- naming cells ----


@examples(25)
@given(spaces(max_spans=4), seeds())
def test_a_mask_and_rows_name_the_cells_of_a_mapping(space, rng):
    mask = rng.random(len(space.cells)) < 0.4
    rows = space.cells[mask]
    mapping = {level: rows[rows[:, 0] == level, 1:].tolist() for level in range(space.levels)}
    wanted = space.refine(mapping)
    children = {(level + 1, 2 * i + a, 2 * j + b) for level, i, j in rows.tolist() for a, b in FOUR}
    assert cells_of(wanted) == cells_of(space) - set(map(tuple, rows.tolist())) | children
    for cells in (mask, mask.tolist(), rows, rows[::-1].tolist(), np.tile(rows, (2, 1))):
        assert cells_of(space.refine(cells)) == cells_of(wanted)
    assert cells_of(wanted.coarsen(rows)) == cells_of(space)


# ---- boxes ----


@examples(25)
@given(hierarchies(max_spans=4, deepest=2), st.integers(0, 3), seeds())
def test_a_box_cuts_the_cells_that_meet_it_down_to_the_level(case, level, rng):
    """Cell by cell, each on its own; half of the sides lie on breaks of level 2."""
    space, _ = case
    sides, breaks = [], []
    for kv in (space.kv_u, space.kv_v):
        marks = np.r_[kv.breaks, rng.uniform(kv.start, kv.stop, 4), -np.inf, np.inf]
        sides.append(sorted(rng.choice(np.unique(np.r_[marks, marks / 2 + kv.start / 2]), 2, replace=False)))
        breaks.append(kv.breaks.tolist())
    if not all(low < kv.stop and high > kv.start for kv, (low, high) in zip((space.kv_u, space.kv_v), sides)):
        with pytest.raises(ValueError, match="must increase and meet the domain"):
            space.refine_box(level, *sides)
        return

    def end(row, number, k):
        whole, part = divmod(k, 2**number)
        return row[whole] + (row[whole + 1] - row[whole]) * part / 2**number if part else row[whole]

    wanted, left = set(), list(cells_of(space))
    while left:
        number, *cell = left.pop()
        meets = all(
            end(row, number, k) < high and end(row, number, k + 1) > low
            for row, k, (low, high) in zip(breaks, cell, sides)
        )
        if meets and number < level:
            left += [(number + 1, 2 * cell[0] + a, 2 * cell[1] + b) for a, b in FOUR]
        else:
            wanted.add((number, *cell))
    assert cells_of(space.refine_box(level, *sides)) == wanted


def test_a_box_of_a_class_keeps_it():
    space = uniform_space(2, 4).refine_box(5, (0.3, 0.31), (0.6, 0.61), admissible=2)
    assert (space.levels, space.admissibility) == (6, 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((MAX_LEVEL + 1, (0, 1), (0, 1)), "level must be"),
        ((1, (0.5, 0.5), (0, 1)), r"u must increase and meet the domain \[0.0, 1.0\], got \(0.5, 0.5\)"),
        ((1, (0, 1), (1, 2)), r"v must increase and meet the domain"),
        ((1, (0, np.nan), (0, 1)), "u must be a number, got nan"),
        ((1, 0.5, (0, 1)), r"u must be a pair \(start, stop\) of numbers, got 0.5"),
    ],
)
def test_boxes_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        uniform_space().refine_box(*arguments)


# ---- two spaces ----


@examples(25)
@given(st.data())
def test_the_common_refinement_is_the_coarsest_that_holds_both(data):
    start = data.draw(tensor_spaces(max_spans=4)), []
    (a, marked_a), (b, marked_b) = (data.draw(refined_spaces(start, 0, 3, deepest=2)) for _ in range(2))
    both = common_refinement(a, b)
    rows = [enumerate(refined) for refined in (marked_a, marked_b, [c.tolist() for c in both.refined])]
    refined = [{(level, *cell) for level, cells in row for cell in cells} for row in rows]
    assert refined[0] | refined[1] == refined[2]
    assert cells_of(common_refinement(b, a)) == cells_of(both)
    u, v = data.draw(points(both))
    for space in (a, b):
        values = both.collocation(u, v) @ space.prolongation(both) - space.collocation(u, v)
        assert abs(values).max() <= float(gamma(2 * entry_roundings(both)))


NOT_NESTED = uniform_space().refine({0: [(1, 2), (3, 3)]}).refine({1: [(7, 6)]})


@pytest.mark.parametrize(
    ("other", "cell"),
    [
        (uniform_space(), r"\(1, 2\) of level 0"),
        (uniform_space().refine({0: [(1, 2), (2, 1)]}), r"\(3, 3\) of level 0"),
        (uniform_space().refine({0: block(0, 4, 0, 4)}), r"\(7, 6\) of level 1"),
    ],
)
def test_spaces_that_are_not_nested_are_refused_by_a_cell(other, cell):
    with pytest.raises(ValueError, match=f"cell {cell} is refined in the coarser one only"):
        NOT_NESTED.prolongation(other)
    with pytest.raises(ValueError, match=f"cell {cell}"):
        other.restriction(NOT_NESTED)


@pytest.mark.parametrize(
    ("other", "got"),
    [
        (uniform_space(2), "one with another kv_u"),
        (THBSpace(KnotVector.uniform(3, 8), KnotVector.uniform(3, 8, 0, 2)), "one with another kv_v"),
        (5, "int"),
    ],
)
def test_spaces_over_other_knots_are_refused(other, got):
    space = uniform_space()
    for name, refused in (
        ("the finer space", space.prolongation),
        ("the coarser space", space.restriction),
        ("b", lambda other: common_refinement(space, other)),
    ):
        with pytest.raises(ValueError, match=f"{name} must be a THBSpace over the same .*, got {got}"):
            refused(other)


# ---- points on cells ----


@examples(25)
@given(spaces(max_spans=4), seeds())
def test_quadrature_integrates_monomials_of_degree_2n_minus_1_on_every_cell(space, rng):
    n = rng.integers(1, 6, 2)
    a, b = rng.integers(0, 2 * n)
    u, v, weights, cell = space.quadrature(tuple(n.tolist()))
    assert (space.locate(u, v) == cell).all()
    u0, u1, v0, v1 = space.boxes.T
    low, high = u0[cell], v0[cell]  # moments about the corner of each cell, so that none cancels
    found = np.bincount(cell, weights * (u - low) ** a * (v - high) ** b)
    wanted = (u1 - u0) ** (a + 1) / (a + 1) * (v1 - v0) ** (b + 1) / (b + 1)
    # u - u0 has an error of eps |u| in units of the cell's width
    size = max(abs(u).max() / (u1 - u0).min(), abs(v).max() / (v1 - v0).min())
    np.testing.assert_allclose(found, wanted, rtol=float(gamma(8 * (a + b + 1))) * (1 + size))


@examples(25)
@given(spaces(max_spans=3, deepest=2))
def test_quadrature_is_exact_for_products_of_functions_unless_told(space):
    products = [
        a.T @ (weights[:, None] * a)
        for u, v, weights, _ in (space.quadrature(), space.quadrature(8))
        for a in [space.collocation(u, v).toarray()]
    ]
    assert abs(products[0] - products[1]).max() <= 1e-13 * abs(products[1]).max()  # sums of up to 10^3 terms


@pytest.mark.parametrize("n", [0, 101, 2.0, (2, 0), (1, 2, 3), "a"])
def test_counts_of_points_are_refused(n):
    with pytest.raises(ValueError, match="the number of points must be an integer from 1 to 100, got"):
        uniform_space().quadrature(n)


@examples(25)
@given(st.data())
def test_the_spline_with_the_greville_points_is_the_identity(data):
    """By the truncated functions as they are defined."""
    space, refined = data.draw(hierarchies(max_spans=3, deepest=2))
    u, v = data.draw(points(space))
    net = space.greville()
    assert net.shape == (space.dim, 2)
    twin = DefinitionTHB(space.kv_u, space.kv_v, refined)
    size = max(abs(kv.knots).max() for kv in (space.kv_u, space.kv_v))
    roundings = 4 * sum(len(k) for k in twin.knots) + 10 * sum(twin.degrees) + entry_roundings(space)
    error = twin.collocation(u, v) @ net - np.stack([u, v], axis=1)
    assert abs(error).max() <= float(gamma(roundings)) * size


def test_greville_points_are_those_of_the_functions_levels():
    kv_u, kv_v = KnotVector(2, [0, 0, 0, 0.3, 0.3, 1, 1, 1]), KnotVector.uniform(3, 4)
    space = THBSpace(kv_u, kv_v).refine(np.ones(8, dtype=bool)).refine({1: block(0, 4, 0, 6)})
    finer = [kv_u.bisect(), kv_v.bisect()], [kv_u.bisect().bisect(), kv_v.bisect().bisect()]
    wanted = [
        (finer[level - 1][0].greville()[i], finer[level - 1][1].greville()[j])
        for level, i, j in space.functions.tolist()
    ]
    assert abs(space.greville() - wanted).max() <= 2e-16
    flat = THBSpace(kv_u, kv_v).greville().reshape(kv_u.dim, kv_v.dim, 2)
    assert (flat == np.stack(np.meshgrid(kv_u.greville(), kv_v.greville(), indexing="ij"), axis=2)).all()
