"""THB surfaces on periodic knots: tubes that are refined around."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.cases import examples
from tests.thbcad.cases import seeds
from thbcad import KnotVector, THBSpace, THBSurface

EPS = np.finfo(float).eps


def ring(space, level, rows):
    """All leaf cells of a level in some rows: around the whole tube."""
    cells = space.cells[(space.cells[:, 0] == level) & np.isin(space.cells[:, 2], list(rows)), 1:]
    return {level: cells}


def tube(degree, spans):
    """A tube refined around two rings, the second within the first, and on one side in between."""
    space = THBSpace(KnotVector.periodic(degree, np.arange(spans + 1.0)), KnotVector.uniform(2, 6))
    space = space.refine(ring(space, 0, range(1, 5)))
    space = space.refine(ring(space, 1, range(4, 8)))
    far = (spans // 2) * 2
    return (
        space.refine({1: [(far + a, 8 + b) for a in (0, 1) for b in (0, 1)]}) if spans > degree + 2 else space
    )


@examples(20)
@given(st.integers(1, 5), st.integers(1, 9), seeds())
def test_values_and_derivatives_agree_at_the_seam(degree, spans, rng):
    space = tube(degree, spans)
    wrapping = space.wrapping()
    surface = THBSurface(space, wrapping @ rng.uniform(-1, 1, (wrapping.shape[1], 3)))
    finer = surface.refine(ring(space, 2, range(8, 14)))
    v = np.linspace(0, 1, 41)
    for one in (surface, finer):
        for derivative in range(degree):
            before, after = (one(np.full(41, u), v, (derivative, 0)) for u in (float(spans), 0.0))
            # differences over the finest spans, 1/8, of coefficients within 1
            assert abs(before - after).max() <= 100 * degree * EPS * (16 * degree) ** derivative


@examples(20)
@given(st.integers(1, 3), st.integers(2, 5), seeds())
def test_any_torus_that_wraps_is_closed_both_ways(degree, spans, rng):
    """Random boxes of cells across both seams are refined; some spaces are refused, all others are smooth."""
    kvs = KnotVector.periodic(degree, np.arange(spans + 1.0)), KnotVector.periodic(2, np.arange(5.0))
    space, sizes = THBSpace(*kvs), (spans, 4)
    for level in range(2):
        cells = space.cells[space.cells[:, 0] == level, 1:]
        around = [
            (cells[:, d] - rng.integers(99)) % (n << level) < rng.integers(2, n + 1) << level
            for d, n in enumerate(sizes)
        ]
        space = space.refine({level: cells[around[0] & around[1]]})
    try:
        wrapping = space.wrapping()
    except ValueError:  # a function is active on one side of a seam only
        return
    torus = THBSurface(space, wrapping @ rng.uniform(-1, 1, wrapping.shape[1]))
    x = [np.linspace(0, n, 33) for n in sizes]
    for order in range(degree):
        ends = torus.grid([0.0, float(spans)], x[1], (order, 0))
        assert abs(ends[0] - ends[1]).max() <= 100 * degree * EPS * (8 * degree) ** order
    for order in range(2):
        ends = torus.grid(x[0], [0.0, 4.0], (0, order))
        assert abs(ends[:, 0] - ends[:, 1]).max() <= 200 * EPS * 16**order


def test_the_periodic_functions_are_a_partition_of_unity_and_as_many_as_the_cells_say():
    """On n spans, n 2^l functions of a level for every row of functions that are active."""
    space = tube(3, 5)
    wrapping = space.wrapping()
    rows = [set(space.functions[space.functions[:, 0] == level, 2].tolist()) for level in range(space.levels)]
    assert wrapping.shape == (space.dim, sum(5 * 2**level * len(r) for level, r in enumerate(rows)))
    u, v = np.random.default_rng(0).uniform(0, 1, (2, 30)) * [[5], [1]]
    a = space.collocation(u, v) @ wrapping
    assert abs(a.sum(axis=1) - 1).max() <= 40 * EPS
    assert a.min() >= -EPS
    assert np.linalg.matrix_rank((space.collocation(*on_grid(5)) @ wrapping).toarray()) == wrapping.shape[1]


def on_grid(spans):
    u, v = np.meshgrid((np.arange(spans * 8) + 0.3) / 8, (np.arange(48) + 0.3) / 48)
    return u.ravel(), v.ravel()


def test_every_form_is_the_same_tube():
    """Tensor-product form, patches, faces and coarsening know nothing of the seam."""
    space = tube(3, 8)
    rng = np.random.default_rng(1)
    surface = THBSurface(space, rng.uniform(-1, 1, (space.dim, 3)))
    u, v = rng.uniform(0, 8, 60), rng.random(60)
    assert abs(surface.to_bspline()(u, v) - space.collocation(u, v) @ surface.coefficients).max() <= 1e-14
    for pieces in (surface.to_patches(), surface.to_faces(5)):
        for piece in pieces:
            (u0, u1), (v0, v1) = ((kv.start, kv.stop) for kv in piece.knot_vectors)
            x, y = (np.linspace(a, b, 4) for a, b in ((u0, u1), (v0, v1)))
            assert abs(piece.grid(x, y) - surface.grid(x, y)).max() <= 1e-13
    finer = surface.refine({0: space.cells[space.cells[:, 0] == 0, 1:][:9]})
    back = finer.space.restriction(space) @ finer.coefficients
    assert abs(back - surface.coefficients).max() <= 1e-12


def test_cells_that_are_refined_on_one_side_of_the_seam_only_are_refused():
    space = THBSpace(KnotVector.periodic(2, np.arange(7.0)), KnotVector.uniform(2, 4))
    one_side = space.refine({0: [(5, j) for j in range(4)]})
    with pytest.raises(ValueError, match="active on one side of the seam only"):
        one_side.wrapping()
    both = one_side.refine({0: [(i, j) for i in (0, 1, 4) for j in range(4)]})
    assert both.wrapping().shape[1] < both.dim
    with pytest.raises(ValueError, match="needs periodic knots"):
        THBSpace(space.kv_v, space.kv_v).wrapping()
