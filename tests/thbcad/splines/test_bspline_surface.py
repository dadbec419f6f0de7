"""Tensor-product and THB surfaces against scipy and among themselves."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from oracles.spline_definitions import DefinitionTHB, gamma, gauss
from tests.thbcad.cases import (
    coefficients,
    hierarchies,
    points,
    refined_spaces,
    scipy_twin,
    spaces,
    tensor_spaces,
)
from thbcad.hierarchy import THBSpace
from thbcad.splines.bsplines import BSplineCurve, BSplineSurface
from thbcad.splines.knot_vector import KnotVector
from thbcad.surfaces import THBSurface

EPS = np.finfo(float).eps
ORDERS = [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 3), (2, 2)]
KV_U = KnotVector(3, [0, 0, 0, 0, 1, 1.5, 1.5, 3, 3, 3, 3])
KV_V = KnotVector(2, [-1, -1, -1, 0, 2, 2, 4, 4, 4])


def slope_scale(surface, order):
    """Bound on the size of the terms of a derivative: the product of (2 p / shortest span)^r."""
    kvs = surface.kv_u, surface.kv_v
    return np.prod([(2 * kv.degree / np.diff(kv.breaks).min()) ** r for kv, r in zip(kvs, order)])


def roundings(surface):
    p, q = surface.kv_u.degree, surface.kv_v.degree
    return 2 * (5 * (p + q) + (p + 2) * (q + 2))


@st.composite
def bspline_surfaces(draw, *tail):
    space = draw(tensor_spaces(max_degree=5))
    return BSplineSurface(
        space.kv_u, space.kv_v, draw(coefficients(space.kv_u.dim, space.kv_v.dim, *tail))
    ), space


@st.composite
def thb_surfaces(draw, *tail):
    space = draw(spaces())
    return THBSurface(space, draw(coefficients(space.dim, *tail)))


@given(st.data(), st.integers(0, 2), st.integers(0, 2))
def test_elevated_is_the_same_surface(data, more_u, more_v):
    tail = data.draw(st.sampled_from([(), (3,)]))
    surface, space = data.draw(bspline_surfaces(*tail))
    degrees = surface.kv_u.degree + more_u, surface.kv_v.degree + more_v
    finer = surface.elevate(*degrees)
    assert (finer.kv_u.degree, finer.kv_v.degree) == degrees
    assert (finer.kv_u.spans, finer.kv_v.spans) == (surface.kv_u.spans, surface.kv_v.spans)
    assert surface.elevate(1, 1).coefficients.tolist() == surface.coefficients.tolist()
    u, v = data.draw(points(space))
    # means with weights >= 0 of coefficients up to 1: one elevation takes some 7 roundings per degree
    tolerance = float(gamma(2 * roundings(finer) + 8 * (more_u + more_v) * max(degrees)))
    assert abs(finer(u, v) - surface(u, v)).max(initial=0) <= tolerance * abs(surface.coefficients).max()


@pytest.mark.parametrize("order", ORDERS)
@given(data=st.data())
def test_scattered_and_grid_against_scipy(order, data):
    tail = data.draw(st.sampled_from([(), (1,), (3,)]))
    surface, space = data.draw(bspline_surfaces(*tail))
    u, v = data.draw(points(space))
    want = scipy_twin(surface)(np.stack([u, v], axis=-1), nu=order)
    tolerance = float(gamma(2 * roundings(surface))) * slope_scale(surface, order)
    got = surface(u, v, order)
    assert got.shape == want.shape == (len(u), *tail)
    assert abs(got - want).max() <= tolerance
    grid = surface.grid(u, v, order)
    assert grid.shape == (len(u), len(v), *tail)
    assert abs(grid[np.arange(len(u)), np.arange(len(u))] - want).max() <= tolerance


def test_grid_of_unequal_sides():
    surface = BSplineSurface(KV_U, KV_V, np.arange(7.0 * 6 * 2).reshape(7, 6, 2) % 11)
    u, v = np.linspace(0, 3, 4), np.linspace(-1, 4, 7)
    grid = surface.grid(u, v, (1, 1))
    assert grid.shape == (4, 7, 2)
    for i, a in enumerate(u):
        assert abs(grid[i] - surface(np.full(7, a), v, (1, 1))).max() <= float(
            gamma(roundings(surface))
        ) * 11 * slope_scale(surface, (1, 1))


def test_corners_and_linear_precision():
    """Corner values are the corner coefficients; Greville nets give the parameters back."""
    net = np.stack(np.meshgrid(KV_U.greville(), KV_V.greville(), indexing="ij"), axis=-1)
    surface = BSplineSurface(KV_U, KV_V, net)
    u, v = np.linspace(0, 3, 13), np.linspace(-1, 4, 13)
    assert abs(surface(u, v) - np.stack([u, v], axis=-1)).max() <= float(gamma(roundings(surface))) * 4
    corners = surface.grid([0.0, 3.0], [-1.0, 4.0])
    assert abs(corners - net[:: len(net) - 1, :: net.shape[1] - 1]).max() <= float(gamma(5 * 5 + 4)) * 4


@given(data=st.data())
def test_integral_against_quadrature(data):
    surface, _ = data.draw(bspline_surfaces(2))
    (s, ws), (t, wt) = (gauss(kv.breaks, kv.degree // 2 + 1) for kv in (surface.kv_u, surface.kv_v))
    want = np.einsum("i,j,ijd->d", ws, wt, surface.grid(s, t))
    area = (surface.kv_u.stop - surface.kv_u.start) * (surface.kv_v.stop - surface.kv_v.start)
    assert surface.integral().shape == (2,)
    # weights and nodes of leggauss are accurate to a few eps; a node error moves the value by its slope
    slope = slope_scale(surface, (1, 0)) + slope_scale(surface, (0, 1))
    assert abs(surface.integral() - want).max() <= float(
        gamma(2 * roundings(surface) + len(s) * len(t))
    ) * area * (4 + 4 * slope)


def test_integral_of_one_is_the_area():
    assert BSplineSurface(KV_U, KV_V, np.ones((7, 6))).integral() == pytest.approx(15, rel=1e-14)


# ---- THB surfaces ----


@given(thb_surfaces(), st.data())
def test_to_bspline_is_the_same_surface(surface, data):
    """Scattered, grid and collocation agree with scipy on the tensor-product form."""
    flat = surface.to_bspline()
    u, v = data.draw(points(surface.space))
    for order in ORDERS[:4]:
        want = scipy_twin(flat)(np.stack([u, v], axis=-1), nu=order)
        tolerance = float(gamma(2 * roundings(flat) * (1 + surface.space.levels))) * slope_scale(flat, order)
        assert abs(surface(u, v, order) - want).max() <= tolerance
        assert abs(np.diagonal(surface.grid(u, v, order)) - want).max() <= tolerance
        assert abs(surface.space.collocation(u, v, order) @ surface.coefficients - want).max() <= tolerance


@given(st.data())
def test_to_bspline_is_exact_by_definition(data):
    """The net over the needed knots, refined to the full finest level, is the net that the definition
    gives."""
    space, refined = data.draw(hierarchies(max_spans=3, deepest=2))
    c = data.draw(coefficients(space.dim))
    flat = THBSurface(space, c).to_bspline()
    twin = DefinitionTHB(space.kv_u, space.kv_v, refined)
    fine = [KnotVector(kv.degree, knots) for kv, knots in zip((flat.kv_u, flat.kv_v), twin.knots)]
    net = flat.kv_u.prolongation(fine[0]) @ (flat.kv_v.prolongation(fine[1]) @ flat.coefficients.T).T
    count = 4 * sum(len(k) for k in twin.knots) + roundings(flat) * (2 + space.levels) + space.dim
    assert abs(net - twin.nets @ c).max() <= float(gamma(count))


@given(st.data())
def test_to_bspline_carries_only_needed_knots(data):
    """A new knot line is in the tensor-product form exactly when some refined cell has it as its middle."""
    space, refined = data.draw(hierarchies())
    flat = THBSurface(space, np.zeros(space.dim)).to_bspline()
    for kv, new, d in ((space.kv_u, flat.kv_u, 0), (space.kv_v, flat.kv_v, 1)):
        wanted = set(kv.breaks.tolist())
        for level, cells in enumerate(refined):
            for k in {cell[d] for cell in cells}:
                low, high = kv.breaks[k >> level], kv.breaks[(k >> level) + 1]
                wanted.add(float(low + (high - low) * ((k % 2**level) + 0.5) / 2**level))
        assert set(new.breaks.tolist()) == wanted
        assert len(new.knots) == len(kv.knots) + len(wanted) - len(kv.breaks)


@given(st.data())
def test_refine_keeps_the_surface(data):
    start = data.draw(hierarchies(max_steps=3))
    c = data.draw(coefficients(start[0].dim, 2))
    surface = THBSurface(start[0], c)
    before = surface.coefficients.copy()
    cells = data.draw(refined_spaces(start, max_steps=1))[0]
    new = {
        level: [tuple(x) for x in set(map(tuple, a.tolist())) - set(map(tuple, b.tolist()))]
        for level, (a, b) in enumerate(zip(cells.refined, (*start[0].refined, np.zeros((0, 2), int))))
    }
    finer = surface.refine(new)
    u, v = data.draw(points(start[0]))
    assert finer.space.dim == cells.dim
    for order in [(0, 0), (1, 0), (0, 1)]:
        flat = finer.to_bspline()
        tolerance = float(gamma(4 * roundings(flat) * (1 + cells.levels))) * slope_scale(flat, order)
        assert abs(finer(u, v, order) - surface(u, v, order)).max() <= tolerance
    assert (surface.coefficients == before).all()


def test_vector_coefficients_are_columns():
    space = THBSpace(KV_U, KV_V).refine({0: [(0, 0), (1, 1), (0, 1), (1, 0)]})
    c = np.random.default_rng(5).normal(size=(space.dim, 3))
    u, v = np.linspace(0, 3, 9), np.linspace(-1, 4, 9)
    whole = THBSurface(space, c)
    assert whole(u, v).shape == (9, 3)
    assert whole.grid(u, v[:4]).shape == (9, 4, 3)
    for d in range(3):
        assert (whole(u, v)[:, d] == THBSurface(space, c[:, d])(u, v)).all()
    assert THBSurface(space, c[:, :1])(u, v).shape == (9, 1)


def test_a_function_of_the_basis_is_local():
    """One coefficient moves the surface only on the support of its function."""
    space = THBSpace(KnotVector.uniform(2, 8), KnotVector.uniform(2, 8)).refine(
        {0: [(i, j) for i in range(4) for j in range(4)]}
    )
    k = space.functions.tolist().index([1, 2, 3])
    c = np.zeros(space.dim)
    c[k] = 1
    x = (np.arange(32) + 0.5) / 32
    values = THBSurface(space, c).grid(x, x)
    inside = (x > 0) & (x < 3 / 16), (x > 1 / 16) & (x < 4 / 16)
    assert (values[np.ix_(*inside)] > 0).all()
    values[np.ix_(*inside)] = 0
    assert (values == 0).all()


def test_coefficients_are_read_only_copies():
    space = THBSpace(KV_U, KV_V)
    c = np.zeros(space.dim)
    surface = THBSurface(space, c)
    c[:] = 7
    assert surface([0.5], [0.5]).tolist() == [0]
    for array in (surface.coefficients, surface.to_bspline().coefficients):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


# ---- errors ----


@pytest.mark.parametrize("shape", [(6, 7), (7,), (42,), (7, 6, 3, 1), ()])
def test_tensor_coefficients_of_wrong_shape_are_refused(shape):
    with pytest.raises(ValueError, match=r"coefficients must have shape \(7, 6\) or \(7, 6, 'd'\), got"):
        BSplineSurface(KV_U, KV_V, np.zeros(shape))


@pytest.mark.parametrize("shape", [(41,), (6, 7), (7, 6, 2, 2), (42, 2, 2), ()])
def test_thb_coefficients_of_wrong_shape_are_refused(shape):
    with pytest.raises(ValueError, match=r"coefficients must have shape \(42,\) or \(42, d\), got"):
        THBSurface(THBSpace(KV_U, KV_V), np.zeros(shape))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_coefficients_that_are_not_finite_are_refused(bad):
    c = np.zeros(42)
    c[17] = bad
    with pytest.raises(ValueError, match="coefficients must be finite"):
        THBSurface(THBSpace(KV_U, KV_V), c)
    with pytest.raises(ValueError, match="coefficients must be finite"):
        BSplineSurface(KV_U, KV_V, c.reshape(7, 6))


def test_a_scalar_curve_of_a_scalar_is_a_scalar():
    curve = BSplineCurve(KnotVector.uniform(3, 4), np.arange(7.0))
    assert isinstance(curve(0.5), np.float64)
    assert curve(0.5) == curve([0.5])[0] == pytest.approx(3.0)
    assert curve(0.5, 1) == pytest.approx(4.0)
