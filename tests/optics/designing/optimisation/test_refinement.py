"""Marking: the indicator per cell, the threshold, and symmetry."""

import numpy as np
import pytest

from optics.designing.optimisation.indicators import mark, vertex_knots
from optics.designing.starts import summed_over_cells
from tests.optics.cases import small_space
from thbcad.hierarchy import THBSpace
from thbcad.splines import KnotVector


def boxes(space):
    """Return the leaf cells' (x0, x1, y0, y1), by halving the uniform level-0 spans."""
    rows = []
    for level, i, j in space.cells.tolist():
        ends = []
        for kv, k in ((space.kv_u, i), (space.kv_v, j)):
            size = (kv.stop - kv.start) / (kv.spans * 2**level)
            ends += [kv.start + k * size, kv.start + (k + 1) * size]
        rows.append(ends)
    return np.array(rows)


def brute_indicator(space, x, y, gradients):
    """Return the sum of the gradients of the vertices in every leaf cell; shared sides belong to the upper
    cell, ends to the last."""
    out = np.zeros(len(space.cells))
    for cell, (x0, x1, y0, y1) in enumerate(boxes(space)):
        for i, xi in enumerate(x):
            for j, yj in enumerate(y):
                in_x = x0 <= xi < x1 or xi == x1 == space.kv_u.stop
                in_y = y0 <= yj < y1 or yj == y1 == space.kv_v.stop
                out[cell] += gradients[i, j] * (in_x and in_y)
    return out


def uniform_space(spans=(4, 4), half_width=(10.0, 8.0)):
    return THBSpace(*(KnotVector.uniform(3, n, -h, h) for n, h in zip(spans, half_width)))


def test_vertices_form_the_grid_with_both_borders():
    knots = vertex_knots((10.0, 8.0), (6, 9))
    np.testing.assert_allclose(knots[0].greville(), np.linspace(-10, 10, 6), atol=1e-15)
    np.testing.assert_allclose(knots[1].greville(), np.linspace(-8, 8, 9), atol=1e-15)
    assert [kv.degree for kv in knots] == [1, 1]


@pytest.mark.parametrize("counts", [(24, 30), (17, 9), (5, 5)])
def test_indicator_sums_the_vertices_of_every_leaf_cell(counts):
    space = small_space((10.0, 8.0))
    gradients = np.random.default_rng(1).uniform(0, 1, counts)
    knots = vertex_knots((10.0, 8.0), counts)
    found = summed_over_cells(space, *(kv.greville() for kv in knots), gradients)
    expected = brute_indicator(
        space, np.linspace(-10, 10, counts[0]), np.linspace(-8, 8, counts[1]), gradients
    )
    np.testing.assert_allclose(found, expected, rtol=1e-14)
    assert found.sum() == pytest.approx(gradients.sum(), rel=1e-14)


def test_marking_compares_with_the_mean_over_the_active_cells():
    """Six cells, mean 2: with alpha = 1 those above 2 are marked, with alpha = 1/2 those above 1; equal is
    not above."""
    space = uniform_space((3, 2))
    indicator = np.array([0.0, 1.0, 2.0, 2.5, 5.5, 1.0])
    cells = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)]

    def marked(alpha):
        return {tuple(c) for c in mark(space, indicator, alpha, 5).get(0, np.empty((0, 2), int)).tolist()}

    assert marked(1.0) == {cells[3], cells[4]}
    assert marked(0.5) == {cells[2], cells[3], cells[4]}
    assert marked(0.0) == set(cells[1:])
    assert marked(10.0) == set()
    assert mark(space, indicator, 10.0, 5) == {}


def test_marking_reports_cells_by_their_own_level():
    space = uniform_space((2, 1)).refine({0: [(1, 0)]})
    # leaf cells: (0, 0, 0), then the four children of (1, 0)
    marked = mark(space, np.array([3.0, 0.0, 2.0, 0.0, 4.0]), 1.0, 5)
    assert {level: cells.tolist() for level, cells in marked.items()} == {0: [[0, 0]], 1: [[2, 1], [3, 1]]}
    finer = space.refine(marked)
    assert finer.levels == 3


def test_no_threshold_marks_every_cell_with_a_gradient():
    space = small_space()
    indicator = np.random.default_rng(1).uniform(0, 1, len(space.cells)) * (
        np.arange(len(space.cells)) % 3 > 0
    )
    marked = mark(space, indicator, 0.0, 9)
    assert sum(map(len, marked.values())) == np.count_nonzero(indicator)


def test_zero_gradients_mark_nothing():
    space = small_space()
    assert mark(space, np.zeros(len(space.cells)), 0.0, 9) == {}


@pytest.mark.parametrize("max_level", [0, 1, 2, 3])
def test_no_cell_is_refined_beyond_the_finest_level(max_level):
    space = small_space()
    marked = mark(space, np.ones(len(space.cells)), 0.0, max_level)
    assert all(level < max_level for level in marked)
    levels = space.cells[:, 0]
    assert sum(map(len, marked.values())) == np.count_nonzero(levels < max_level)
    assert space.refine(marked).levels <= max(max_level + 1, space.levels)


def test_a_mirror_symmetric_indicator_keeps_the_mesh_symmetric():
    space, rng = uniform_space((5, 6)), np.random.default_rng(3)
    for level in range(3):
        quarter = rng.uniform(0, 1, (15, 16)) ** 4
        gradients = np.block([[quarter, quarter[:, ::-1]], [quarter[::-1], quarter[::-1, ::-1]]])
        knots = vertex_knots(
            (10.0, 8.0), gradients.shape
        )  # 30 x 32 vertices: none but the border on a knot line
        indicator = summed_over_cells(space, *(kv.greville() for kv in knots), gradients)
        marked = mark(space, indicator, 0.8, level + 1)
        assert 0 < sum(map(len, marked.values())) < len(space.cells)
        space = space.refine(marked)
        cells = {tuple(c) for c in space.cells.tolist()}
        assert {(n, (5 << n) - 1 - i, j) for n, i, j in cells} == cells
        assert {(n, i, (6 << n) - 1 - j) for n, i, j in cells} == cells
