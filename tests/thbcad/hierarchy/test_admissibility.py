"""Admissible refinement, and the hierarchical basis that is not truncated."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from oracles.spline_definitions import DefinitionTHB
from tests.cases import examples
from tests.thbcad.cases import hierarchies, points, seeds, spaces, tensor_spaces
from thbcad import KnotVector, THBSpace


def some_leaves(rng, space, deepest):
    """A few neighbouring leaf cells of one level."""
    leaves = space.cells[space.cells[:, 0] < deepest]
    level, i, j = leaves[rng.integers(len(leaves))]
    near = (leaves[:, 0] == level) & (abs(leaves[:, 1:] - (i, j)) <= rng.integers(0, 4)).all(axis=1)
    return {int(level): leaves[near, 1:]}


def coarsest_above(space):
    """Return how many levels the coarsest function on a cell lies above it, at most."""
    acting = space.incidence()
    rows = np.repeat(np.arange(len(space.cells)), np.diff(acting.indptr))
    return (space.cells[rows, 0] - space.functions[acting.indices, 0]).max()


@pytest.mark.slow
@examples(40)
@given(tensor_spaces(max_degree=4), st.integers(2, 4), seeds())
def test_the_class_is_kept(space, m, rng):
    for _ in range(6):
        cells = some_leaves(rng, space, 5)
        finer = space.refine(cells, admissible=m)
        assert coarsest_above(finer) < m
        assert finer.admissibility <= m
        plain = space.refine(cells)
        assert all(
            set(map(tuple, a.tolist())) <= set(map(tuple, b.tolist()))
            for a, b in zip(plain.refined, finer.refined)
        )
        space = finer


def test_without_it_the_class_grows():
    """Three cells across are too few for cubics: coarse functions reach down to the deepest cells."""
    kv = KnotVector.uniform(3, 8)
    plain = graded = THBSpace(kv, kv)
    for level in range(5):
        block = (8 << level) // 2 - 1 + np.argwhere(np.ones((3, 3)))
        plain = plain.refine({level: block})
        graded = graded.refine({level: block}, admissible=2)
    assert (plain.admissibility, plain.levels) == (6, 6)
    assert graded.admissibility == 2
    assert plain.dim < graded.dim < 3 * plain.dim


def test_a_wide_refinement_needs_no_neighbours():
    kv = KnotVector.uniform(3, 8)
    space = THBSpace(kv, kv).refine({0: np.argwhere(np.ones((8, 8)))})
    assert space.admissibility == 1
    block = 4 + np.argwhere(np.ones((6, 6)))
    assert space.refine({1: block}, admissible=2).dim == space.refine({1: block}).dim


def levels_on_cells(space, refined):
    """Return for every leaf cell the levels of the functions that are not zero in it, by brute force.

    What is positive at one point inside a cell is so everywhere inside, as nets of THB functions are.
    """
    twin = DefinitionTHB(space.kv_u, space.kv_v, refined)
    u0, u1, v0, v1 = space.boxes.T
    values = twin.collocation(0.3 * u0 + 0.7 * u1, 0.4 * v0 + 0.6 * v1)
    levels = np.array(twin.functions)[:, 0]
    return [levels[row > 0] for row in values]


@given(hierarchies())
def test_admissibility_by_definition(pair):
    """Of all levels on a cell, as A. Buffa and C. Giannelli define it."""
    found = levels_on_cells(*pair)
    assert pair[0].admissibility == max(np.ptp(levels) + 1 for levels in found)


def test_the_level_of_a_cell_does_not_count():
    """One fine cell is too small for functions of its own: only those of level 0 act on it."""
    kv = KnotVector.uniform(3, 8)
    space = THBSpace(kv, kv).refine({0: [(4, 4)]})
    assert space.levels == 2
    assert space.admissibility == 1
    assert {0} == set(np.concatenate(levels_on_cells(space, [{(4, 4)}])))


@pytest.mark.parametrize("m", [1, 0, -2, 2.0, True, "2"])
def test_the_class_is_refused(m):
    kv = KnotVector.uniform(2, 4)
    with pytest.raises(ValueError, match="the class of admissibility must be an integer of at least 2, got"):
        THBSpace(kv, kv).refine({0: [(0, 0)]}, admissible=m)


@pytest.mark.parametrize("cells", [{0: [(0, 9)]}, {1: [(0, 0)]}])
def test_cells_are_checked_before_neighbours(cells):
    kv = KnotVector.uniform(2, 4)
    with pytest.raises(ValueError, match=r"lies outside|does not exist"):
        THBSpace(kv, kv).refine(cells, admissible=2)


@given(st.data())
def test_hierarchical_functions_are_whole_b_splines(data):
    """Column f of collocation @ H is the tensor-product B-spline (level, i, j) itself."""
    space = data.draw(spaces())
    u, v = data.draw(points(space))
    found = (space.collocation(u, v) @ space.hierarchical()).toarray()
    vectors = [(space.kv_u, space.kv_v)]
    for _ in range(space.levels - 1):
        vectors.append(tuple(kv.bisect() for kv in vectors[-1]))
    for column, (level, i, j) in zip(found.T, space.functions.tolist()):
        by_u, by_v = (kv.collocation(x).toarray() for kv, x in zip(vectors[level], (u, v)))
        assert np.allclose(column, by_u[:, i] * by_v[:, j], rtol=0, atol=1e-12)


@given(spaces())
def test_both_bases_span_the_same_space(space):
    h = space.hierarchical()
    assert (h.diagonal() == 1).all()
    assert h.data.min() > 0
    assert (
        abs(np.triu(h.toarray(), 1)).max() == 0
    )  # finer coefficients depend on coarser ones only: invertible
