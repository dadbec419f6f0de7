"""What acts where: local evaluation, incidence, the hierarchical mesh, cost in proportion to cells."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.special import comb

from oracles.spline_definitions import gamma
from tests.thbcad.cases import coefficients, points, spaces
from thbcad import KnotVector, THBSpace, THBSurface
from thbcad.surfaces import STRIP

ORDERS = [(0, 0), (1, 0), (0, 1), (2, 1)]


def diagonal(depth, degree=3, spans=8):
    """A band of five cells along the diagonal, refined `depth` times."""
    kv = KnotVector.uniform(degree, spans)
    space = THBSpace(kv, kv)
    for level in range(depth):
        n = spans << level
        i = np.arange(n)[:, None] + np.zeros(5, dtype=int)
        band = np.stack([i, i + np.arange(-2, 3)], axis=-1).reshape(-1, 2)
        space = space.refine({level: band[((band >= 0) & (band < n)).all(axis=1)]})
    return space


@given(st.data(), st.sampled_from(ORDERS))
def test_cellwise_evaluation_is_the_tensor_product_form(data, order):
    space = data.draw(spaces())
    surface = THBSurface(space, data.draw(coefficients(space.dim, 2)))
    u, v = data.draw(points(space))
    scale = [
        np.diff(kv.breaks).min() / 2 ** (space.levels - 1) / kv.degree for kv in (space.kv_u, space.kv_v)
    ]
    tolerance = float(gamma(40 * (space.kv_u.degree + space.kv_v.degree) * space.levels)) / (
        scale[0] ** order[0] * scale[1] ** order[1]
    )
    assert np.abs(surface._cellwise(u, v, order) - surface.to_bspline()(u, v, order)).max() <= 4 * tolerance


def test_many_points_are_evaluated_strip_by_strip():
    space = diagonal(5)
    surface = THBSurface(space, np.sin(np.arange(3.0 * space.dim)).reshape(space.dim, 3))
    u, v = np.random.default_rng(1).random((2, STRIP + 7))
    values = surface(u, v)
    assert values.shape == (STRIP + 7, 3)
    for own in (slice(STRIP - 5, STRIP), slice(STRIP, None), slice(3)):
        assert abs(values[own] - surface(u[own], v[own])).max() <= float(gamma(2 * 16))
    assert surface([], []).shape == (0, 3)


def test_surfaces_that_are_not_compact_are_evaluated_by_cells():
    space = diagonal(5)
    assert not space.is_compact
    surface = THBSurface(space, np.random.default_rng(0).uniform(-1, 1, (space.dim, 2)))
    u, v = np.random.default_rng(1).random((2, 200))
    tensor = surface.to_bspline()
    assert np.allclose(surface(u, v), tensor(u, v), rtol=0, atol=1e-13)
    assert np.allclose(
        surface.grid(u[:9], v[:7], (1, 0)), tensor.grid(u[:9], v[:7], (1, 0)), rtol=0, atol=1e-10
    )


@pytest.mark.slow
def test_cost_is_in_proportion_to_cells_not_to_the_grid():
    """Level 12 along the diagonal: the finest grid has 1e9 cells, the hierarchy half a million."""
    counts = []
    for depth in (6, 9, 12):
        space = diagonal(depth)
        held = sum(space.nets.sizes) + sum(step.nnz for step in space.nets.steps)
        counts.append(held / len(space.cells))
    assert max(counts) < 1.1 * min(counts)
    assert 400_000 < len(space.cells) < 600_000
    u = np.random.default_rng(2).random(50)
    a = space.collocation(np.r_[u, u], np.r_[u, u[::-1]])
    assert np.allclose(a.sum(axis=1), 1, rtol=0, atol=1e-13)
    with pytest.raises(ValueError, match="the tensor-product form needs 32771 x 32771 control points"):
        THBSurface(space, np.zeros(space.dim)).to_bspline()


@given(st.data())
def test_bezier_patches_of_all_cells(data):
    """The middle is the mean with binomial weights; corners are values."""
    space = data.draw(spaces(max_spans=4))
    surface = THBSurface(space, data.draw(coefficients(space.dim, 2)))
    u0, u1, v0, v1 = space.boxes.T
    patches = surface.bernstein()
    assert patches.shape == (len(space.cells), space.kv_u.degree + 1, space.kv_v.degree + 1, 2)
    by_u, by_v = (comb(p, np.arange(p + 1)) / 2**p for p in (space.kv_u.degree, space.kv_v.degree))
    middle = np.einsum("i,cijd,j->cd", by_u, patches, by_v)
    assert np.allclose(middle, surface((u0 + u1) / 2, (v0 + v1) / 2), rtol=0, atol=1e-12)
    assert np.allclose(patches[:, 0, -1], surface(u0, v1), rtol=0, atol=1e-12)


@given(st.data())
def test_incidence_is_where_the_functions_are_not_zero(data):
    """Polynomials that are not zero do not vanish at random points of a cell."""
    space = data.draw(spaces(max_spans=4))
    acting = space.incidence()
    share = np.random.default_rng(5).uniform(0.1, 0.9, (2, len(space.cells)))
    (u0, u1, v0, v1) = space.boxes.T
    values = space.collocation(u0 + share[0] * (u1 - u0), v0 + share[1] * (v1 - v0))
    assert acting.shape == (len(space.cells), space.dim)
    assert acting.dtype == bool
    assert ((values.toarray() > 0) == acting.toarray()).all()
    assert (acting.sum(axis=0) > 0).all()


@given(spaces())
def test_incidence_of_a_tensor_product_space_is_the_local_block(space):
    flat = THBSpace(space.kv_u, space.kv_v)
    assert set(np.diff(flat.incidence().indptr).tolist()) == {
        (space.kv_u.degree + 1) * (space.kv_v.degree + 1)
    }


@given(spaces())
def test_boxes_are_the_cells(space):
    u0, u1, v0, v1 = space.boxes.T
    area = (space.kv_u.stop - space.kv_u.start) * (space.kv_v.stop - space.kv_v.start)
    assert ((u1 - u0) * (v1 - v0)).sum() == pytest.approx(area, rel=1e-13)
    assert (space.locate((u0 + u1) / 2, (v0 + v1) / 2) == np.arange(len(space.cells))).all()
    assert not space.boxes.flags.writeable
