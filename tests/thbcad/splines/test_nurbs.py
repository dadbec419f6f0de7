"""NURBS curves and surfaces against exact arithmetic, OCCT and the properties that define them."""

import re
from fractions import Fraction
from math import comb

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import BSpline

from oracles.spline_definitions import cox_de_boor, gamma
from tests.cases import examples
from tests.thbcad.cases import insertions, nurbs_surfaces, parameters, seeds
from tests.thbcad.splines.cases import curves, geom_curve
from thbcad.cad.shapes import rational_geom
from thbcad.splines.bsplines import BSplineSurface
from thbcad.splines.knot_vector import KnotVector
from thbcad.splines.nurbs import NURBSCurve, NURBSSurface, quotient

QUARTER = NURBSCurve(
    KnotVector.uniform(2, 1), np.array([[1.0, 0], [1, 1], [0, 1]]), np.array([1, np.sqrt(0.5), 1])
)


def rounding(p, extra=0):
    """Bound on the relative error of a rational point of degree p.

    Numerator and denominator are sums of p + 1 terms, positive but for the signs of the points, whose factors
    carry 5 roundings per degree (basis), 1 (homogeneous coefficient) and 1 (product); then one quotient.
    """
    return float(gamma(2 * (6 * p + 3) + 1 + extra))


@st.composite
def curves_and_parameters(draw, **options):
    curve = draw(curves(**options))
    return curve, draw(parameters(curve.kv))


@st.composite
def surfaces_and_parameters(draw):
    surface = draw(nurbs_surfaces())
    u, v = draw(parameters(surface.kv_u)), draw(parameters(surface.kv_v))
    n = min(len(u), len(v))
    return surface, u[:n], v[:n]


def off_knots(kv, u):
    """Parameters between the knots: there OCCT and we agree on the span."""
    k = np.clip(np.searchsorted(kv.breaks, u, "right") - 1, 0, kv.spans - 1)
    low, high = kv.breaks[k], kv.breaks[k + 1]
    return low + (high - low) * np.clip((u - low) / (high - low), 0.01, 0.99)


def majorant(jet, sizes):
    """The recursion of the quotient rule with every minus made plus and every term at its size."""
    signed = sizes.copy()
    signed[..., -1] *= -1
    signed[0, 0, ..., -1] = jet[0, 0, ..., -1]
    return quotient(signed)


# ---- values and derivatives ----


def curve_size(curve, u, order):
    """Size of the terms of a derivative at u, (n, d)."""
    rows = [curve.kv.collocation(u, k) for k in range(order + 1)]
    jet = np.stack([r @ curve.net for r in rows])[:, None]
    return majorant(jet, np.stack([abs(r) @ abs(curve.net) for r in rows])[:, None])


def exact_derivative(curve, u, order):
    """Derivative of (w x) / w by the quotient rule in Fractions, (d,)."""
    kv = curve.kv
    rows = [
        cox_de_boor(kv.knots, kv.degree, u, k)[0] if k <= kv.degree else [Fraction(0)] * kv.dim
        for k in range(order + 1)
    ]
    weights = [Fraction(w) for w in curve.weights.tolist()]
    w = [sum(n * x for n, x in zip(row, weights)) for row in rows]
    out = []
    for component in curve.coefficients.T.tolist():
        wx = [sum(n * a * Fraction(b) for n, a, b in zip(row, weights, component)) for row in rows]
        x = []
        for k in range(order + 1):
            x.append((wx[k] - sum(comb(k, i) * w[i] * x[k - i] for i in range(1, k + 1))) / w[0])
        out.append(x[-1])
    return out


@examples(30)
@given(curves_and_parameters(max_spans=3, max_degree=6), st.integers(0, 4))
def test_points_and_derivatives_are_those_of_exact_arithmetic(case, order):
    """Each of the order + 1 steps of the quotient rule adds the roundings of a point, relative to the size of
    its terms."""
    curve, u = case
    u = u[:3]
    sizes = curve_size(curve, u, order)
    for x, got, size in zip(u, curve(u, order), sizes):
        for a, b, c in zip(got.tolist(), exact_derivative(curve, x, order), size.tolist()):
            assert abs(Fraction(a) - b) <= Fraction((order + 1) * rounding(curve.kv.degree) * c)


@given(curves_and_parameters(max_degree=6), st.integers(0, 5))
def test_curve_derivatives_against_occt(case, order):
    """Any order, above the degree too.

    OCCT expands a span about one of its points: its roundings are relative to the greatest weight, not to
    those near u.
    """
    curve, u = case
    u = off_knots(curve.kv, u)
    geom = geom_curve(curve)
    want = np.array([geom.DN(x, order).Coord() if order else geom.Value(x).Coord() for x in u.tolist()])
    ratio = curve.weights.max() / curve.weights.min()
    bound = 2 * (order + 1) * rounding(curve.kv.degree) * ratio * curve_size(curve, u, order)
    assert (abs(curve(u, order) - want) <= bound).all()


@given(surfaces_and_parameters(), st.integers(0, 3), st.integers(0, 3))
def test_surface_derivatives_against_occt(case, a, b):
    surface, u, v = case
    u, v = off_knots(surface.kv_u, u), off_knots(surface.kv_v, v)
    geom = rational_geom(surface)
    pairs = list(zip(u.tolist(), v.tolist()))
    want = np.array([geom.DN(x, y, a, b).Coord() if a or b else geom.Value(x, y).Coord() for x, y in pairs])
    net = surface.homogeneous.coefficients
    by_u, by_v = (
        [kv.collocation(x, k).toarray() for k in range(n + 1)]
        for kv, x, n in ((surface.kv_u, u, a), (surface.kv_v, v, b))
    )
    jet = np.array([[np.einsum("ki,kj,ijd->kd", r, c, net) for c in by_v] for r in by_u])
    size = majorant(
        jet, np.array([[np.einsum("ki,kj,ijd->kd", abs(r), abs(c), abs(net)) for c in by_v] for r in by_u])
    )
    ratio = surface.weights.max() / surface.weights.min()  # as for curves
    bound = 2 * (a + b + 1) * rounding(surface.kv_u.degree + surface.kv_v.degree) * ratio * size
    assert (abs(surface(u, v, (a, b)) - want) <= bound).all()


@given(surfaces_and_parameters(), st.tuples(st.integers(0, 2), st.integers(0, 2)))
def test_a_grid_holds_the_scattered_values(case, derivative):
    surface, u, v = case
    grid = surface.grid(u, v, derivative)
    assert grid.shape == (len(u), len(v), 3)
    scattered = surface(np.repeat(u, len(v)), np.tile(v, len(u)), derivative).reshape(grid.shape)
    net = surface.homogeneous.coefficients
    by_u, by_v = (
        [abs(kv.collocation(x, k)).toarray() for k in range(n + 1)]
        for kv, x, n in zip((surface.kv_u, surface.kv_v), (u, v), derivative)
    )
    sizes = np.array([[np.einsum("ki,lj,ijd->kld", r, c, abs(net)) for c in by_v] for r in by_u])
    bound = (
        2
        * (sum(derivative) + 1)
        * rounding(surface.kv_u.degree + surface.kv_v.degree)
        * majorant(sizes, sizes)
    )
    assert (abs(grid - scattered) <= bound).all()


@given(curves_and_parameters(), st.integers(0, 3))
def test_one_weight_for_all_is_the_polynomial_spline_of_scipy(case, order):
    curve, u = case
    plain = NURBSCurve(curve.kv, curve.coefficients)
    assert (plain.weights == 1).all()
    want = BSpline(curve.kv.knots, curve.coefficients, curve.kv.degree)(u, nu=order)
    scale = (2 * curve.kv.degree / np.diff(curve.kv.breaks).min()) ** order
    # the derivatives of the weight function 1 are not exactly zero: they add their roundings once per order
    assert abs(plain(u, order) - want).max() <= 2 ** (order + 1) * rounding(curve.kv.degree) * scale


def test_from_bspline_keeps_the_surface():
    kv = KnotVector.uniform(3, 2)
    surface = BSplineSurface(kv, kv, np.random.default_rng(0).uniform(-1, 1, (5, 5, 3)))
    u = np.linspace(0, 1, 7)
    assert (NURBSSurface.from_bspline(surface).coefficients == surface.coefficients).all()
    assert abs(NURBSSurface.from_bspline(surface)(u, u) - surface(u, u)).max() <= rounding(6)


def test_the_quarter_circle_and_its_curvature():
    """Weights 1, sqrt(1/2), 1: |C| = 1 and curvature |C' x C''| / |C'|^3 = 1 everywhere."""
    u = np.linspace(0, 1, 101)
    points, first, second = (QUARTER(u, k) for k in range(3))
    assert abs(np.hypot(*points.T) - 1).max() <= 4 * 2.0**-52
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    assert abs(cross / np.hypot(*first.T) ** 3 - 1).max() <= 1e-13


# ---- the same curve, written otherwise ----


@given(st.data())
def test_knot_insertion_segments_and_elevation_keep_the_curve(data):
    """Homogeneous coefficients of the new curve carry the roundings of the operator; those of both
    evaluations are added."""
    curve, u = data.draw(curves_and_parameters(max_degree=9))
    p = curve.kv.degree
    bound = 4 * rounding(p + 1)
    finer = curve.insert(data.draw(insertions(curve.kv)))
    assert abs(finer(u) - curve(u)).max() <= bound
    higher = curve.elevate(p + 1)
    assert higher.kv.degree == p + 1
    assert abs(higher(u) - curve(u)).max() <= bound
    if u.min() < u.max():
        piece = curve.segment((u.min(), u.max()))
        assert (piece.kv.start, piece.kv.stop) == (u.min(), u.max())
        assert abs(piece(u) - curve(u)).max() <= bound


@given(st.data())
def test_insertion_keeps_the_surface(data):
    surface, u, v = data.draw(surfaces_and_parameters())
    finer = surface.insert(data.draw(insertions(surface.kv_u)), data.draw(insertions(surface.kv_v)))
    assert abs(finer(u, v) - surface(u, v)).max() <= 4 * rounding(surface.kv_u.degree + surface.kv_v.degree)


@examples(30)
@given(nurbs_surfaces())
def test_bezier_patches_and_segments_are_pieces_of_the_surface(surface):
    bound = 4 * rounding(surface.kv_u.degree + surface.kv_v.degree)
    patches = surface.to_bezier()
    assert len(patches) == surface.kv_u.spans * surface.kv_v.spans
    corners = [(a, b) for a in surface.kv_u.breaks[:-1] for b in surface.kv_v.breaks[:-1]]
    assert [(p.kv_u.start, p.kv_v.start) for p in patches] == corners
    s = np.linspace(0, 1, 5)[1:-1]
    for patch in patches:
        u, v = (kv.start + (kv.stop - kv.start) * s for kv in (patch.kv_u, patch.kv_v))
        assert patch.coefficients.shape == (patch.kv_u.degree + 1, patch.kv_v.degree + 1, 3)
        assert abs(patch.grid(u, v) - surface.grid(u, v)).max() <= bound
        piece = surface.segment((patch.kv_u.start, patch.kv_u.stop), (patch.kv_v.start, patch.kv_v.stop))
        assert abs(piece.coefficients - patch.coefficients).max() <= bound


# ---- invariance ----


@given(curves_and_parameters(), st.integers(-20, 20), st.floats(1e-6, 1e6))
def test_only_ratios_of_weights_count(case, power, factor):
    curve, u = case
    doubled = NURBSCurve(curve.kv, curve.coefficients, curve.weights * 2.0**power)
    assert (doubled(u) == curve(u)).all()  # powers of two commute with rounding
    scaled = NURBSCurve(curve.kv, curve.coefficients, curve.weights * factor)
    assert abs(scaled(u) - curve(u)).max() <= 2 * rounding(curve.kv.degree, extra=1)


@given(curves_and_parameters(), seeds())
def test_affine_maps_act_on_the_points(case, rng):
    curve, u = case
    matrix, offset = rng.uniform(-1, 1, (2, 3)), rng.uniform(-1, 1, 2)
    image = curve.transform(matrix, offset)
    # entries within 4 and sums of 4 terms on both sides
    assert abs(image(u) - (curve(u) @ matrix.T + offset)).max() <= 2 * 4 * rounding(curve.kv.degree, extra=8)


def test_affine_maps_of_surfaces():
    rng = np.random.default_rng(1)
    kv = KnotVector.uniform(2, 3)
    surface = NURBSSurface(kv, kv, rng.uniform(-1, 1, (5, 5, 3)), rng.uniform(0.5, 2, (5, 5)))
    matrix, u = rng.uniform(-1, 1, (3, 3)), np.linspace(0, 1, 9)
    assert abs(
        surface.transform(matrix, 2.0).grid(u, u) - surface.grid(u, u) @ matrix.T - 2
    ).max() <= 6 * rounding(4, extra=8)


@given(curves_and_parameters(), seeds())
def test_points_lie_in_the_convex_hull_of_the_points_of_their_span(case, rng):
    curve, u = case
    direction = rng.uniform(-1, 1, 3)
    heights, p = curve.coefficients @ direction, curve.kv.degree
    near = heights[curve.kv.span_of(u)[:, None] - np.arange(p + 1)]
    got, slack = curve(u) @ direction, 3 * rounding(p, extra=6)
    assert (got <= near.max(axis=1) + slack).all()
    assert (got >= near.min(axis=1) - slack).all()


@given(curves_and_parameters(), seeds(), st.floats(1.01, 100))
def test_a_greater_weight_pulls_the_curve_towards_its_point(case, rng, factor):
    curve, u = case
    k = rng.integers(curve.kv.dim)
    pulled = NURBSCurve(
        curve.kv, curve.coefficients, np.where(np.arange(curve.kv.dim) == k, factor, 1.0) * curve.weights
    )
    before, after = (np.linalg.norm(c(u) - curve.coefficients[k], axis=1) for c in (curve, pulled))
    assert (after <= before + 4 * rounding(curve.kv.degree)).all()


# ---- refused ----


def test_arrays_are_read_only_copies():
    points, weights = np.zeros((3, 2)), np.ones(3)
    curve = NURBSCurve(KnotVector.uniform(2, 1), points, weights)
    points[0], weights[0] = 5, 5
    assert curve.coefficients[0].tolist() == [0, 0]
    assert curve.weights[0] == 1
    for array in (curve.coefficients, curve.weights, curve.net):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.parametrize("weight", [0.0, -1.0, np.nan, np.inf, 1e-320, 1e308])
def test_weights_are_refused(weight):
    kv = KnotVector.uniform(2, 1)
    with pytest.raises(
        ValueError, match=rf"weights must lie between 1e-150 and 1e\+150, got {re.escape(str(weight))}"
    ):
        NURBSCurve(kv, np.zeros((3, 2)), np.array([1, weight, 1]))
    with pytest.raises(
        ValueError, match=rf"weights must lie between 1e-150 and 1e\+150, got {re.escape(str(weight))}"
    ):
        NURBSSurface(kv, kv, np.zeros((3, 3, 2)), weight)


@pytest.mark.parametrize(
    ("points", "weights", "message"),
    [
        (np.zeros(3), 1.0, r"coefficients must have shape \(3, 'd'\), got \(3,\)"),
        (np.zeros((4, 2)), 1.0, r"coefficients must have shape \(3, 'd'\), got \(4, 2\)"),
        (np.full((3, 2), np.nan), 1.0, "coefficients must be finite"),
        (np.zeros((3, 2)), np.ones(4), r"weights must be one number or have shape \(3,\), got \(4,\)"),
        (np.zeros((3, 2)), np.ones((3, 1)), r"weights must be one number or have shape \(3,\), got \(3, 1\)"),
    ],
)
def test_shapes_are_refused(points, weights, message):
    with pytest.raises(ValueError, match=message):
        NURBSCurve(KnotVector.uniform(2, 1), points, weights)


def test_scalar_surfaces_are_refused():
    kv = KnotVector.uniform(2, 1)
    with pytest.raises(ValueError, match=r"coefficients must have shape \(3, 3, 'd'\), got \(3, 3\)"):
        NURBSSurface.from_bspline(BSplineSurface(kv, kv, np.zeros((3, 3))))


@pytest.mark.parametrize("derivative", [-1, True, 1.0, None])
def test_derivative_orders_are_refused(derivative):
    with pytest.raises(ValueError, match="derivative must be a non-negative integer"):
        QUARTER([0.5], derivative)


def test_affine_maps_of_wrong_shape_are_refused():
    with pytest.raises(
        ValueError,
        match=r"matrix must have 2 columns, one for each component of the points, got shape \(3, 3\)",
    ):
        QUARTER.transform(np.eye(3))
    with pytest.raises(ValueError, match=r"offset must be one number or have shape \(2,\), got \(3,\)"):
        QUARTER.transform(np.eye(2), [0, 0, 1])


def test_a_printed_curve_or_surface_is_one_line_whatever_its_net():
    kv = KnotVector.uniform(3, 30)
    points = np.random.default_rng(0).uniform(size=(kv.dim, kv.dim, 3))
    assert repr(NURBSSurface(kv, kv, points)) == "NURBSSurface(degree (3, 3), 33 x 33 points in 3 dimensions)"
    assert repr(NURBSCurve(kv, points[0])) == "NURBSCurve(degree 3, 33 points in 3 dimensions)"
