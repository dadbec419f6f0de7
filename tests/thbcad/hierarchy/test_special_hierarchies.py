"""THB spaces at the ends of their range: depth, lone cells, degrees, knots."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from oracles.spline_definitions import gamma
from tests.cases import examples
from tests.thbcad.cases import hierarchies, points
from tests.thbcad.hierarchy.cases import block, dof_per_level, entry_roundings, refined_by, uniform_space
from thbcad.hierarchy.domains import MAX_LEVEL
from thbcad.hierarchy.thb_space import THBSpace
from thbcad.splines import KnotVector


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


@examples(20)
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


@examples(20)
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
