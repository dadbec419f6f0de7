"""Verbs of curves and surfaces against scipy, closed forms and dense samples."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import quad
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from tests.cases import examples
from tests.thbcad.cases import knot_vectors, nurbs_surfaces, parameters, refined_spaces, seeds, tensor_spaces
from tests.thbcad.splines.cases import curves as nurbs_curves
from thbcad import (
    BSplineCurve,
    BSplineSurface,
    KnotVector,
    NURBSCurve,
    NURBSSurface,
    Pose,
    THBSpace,
    THBSurface,
    circular_arc,
    line,
    revolved,
)

EPS = np.finfo(float).eps
CUBIC = KnotVector.uniform(3, 4)
BALL = revolved(circular_arc(5.0, angle=np.pi, start=-np.pi / 2))


@st.composite
def curves(draw, min_degree=1):
    kv, rng = draw(knot_vectors(min_degree=min_degree, max_degree=6)), draw(seeds())
    return BSplineCurve(kv, rng.uniform(-1, 1, (kv.dim, 3)[: draw(st.integers(1, 2))]))


def slope_scale(kv, derivative):
    """Bound on the size of the terms of a derivative."""
    return (2 * kv.degree / np.diff(kv.breaks).min()) ** derivative


# ---- linear maps ----


@given(curves(), st.data())
def test_curves_and_their_derivatives_are_scipys(curve, data):
    u = data.draw(parameters(curve.kv))
    scipys = BSpline(curve.kv.knots, curve.coefficients, curve.kv.degree)
    for order in range(curve.kv.degree + 1):
        got = curve(u, order)
        # 10 roundings per degree and a few of each difference
        assert abs(got - scipys(u, nu=order)).max() <= 20 * curve.kv.degree * EPS * slope_scale(
            curve.kv, order
        )
    width = curve.kv.stop - curve.kv.start
    assert abs(curve.integral() - scipys.integrate(curve.kv.start, curve.kv.stop)).max() <= 100 * EPS * width


@given(curves(min_degree=2), st.data())
def test_the_derivative_is_a_spline_where_the_curve_is_smooth(curve, data):
    u = data.draw(parameters(curve.kv))
    multiplicities = np.unique(curve.kv.knots, return_counts=True)[1][1:-1]
    if multiplicities.max(initial=1) >= curve.kv.degree:
        with pytest.raises(ValueError, match="occurs more than degree"):
            curve.derivative(1)
        return
    found = curve.derivative(1)
    assert found.kv.degree == curve.kv.degree - 1
    assert abs(found(u) - curve(u, 1)).max() <= 20 * curve.kv.degree * EPS * slope_scale(curve.kv, 1)
    assert np.allclose(found.integral(), curve([curve.kv.stop]) - curve([curve.kv.start]), rtol=0, atol=1e-13)


def test_partial_derivatives_are_surfaces():
    rng, u = np.random.default_rng(0), np.linspace(0, 1, 9)
    surface = BSplineSurface(CUBIC, KnotVector.uniform(2, 3), rng.normal(size=(7, 5, 3)))
    mixed = surface.derivative(2, 1)
    assert (mixed.kv_u.degree, mixed.kv_v.degree) == (1, 1)
    assert abs(mixed.grid(u, u) - surface.grid(u, u, (2, 1))).max() <= 1e-11
    with pytest.raises(ValueError, match="derivatives with jumps"):
        surface.derivative(0, 2)


@given(curves(), nurbs_curves(max_degree=5, max_spans=4), st.data())
def test_a_reversed_curve_runs_backwards_and_back_again(polynomial, rational, data):
    for curve in (polynomial, rational):
        u = data.draw(parameters(curve.kv))
        back = curve.reverse()
        assert (back.kv.start, back.kv.stop) == (curve.kv.start, curve.kv.stop)
        # start + stop - u rounds twice, and so does every knot
        reach = 8 * EPS * max(abs(curve.kv.start), abs(curve.kv.stop)) * slope_scale(curve.kv, 1)
        weights = 100 if curve is rational else 1
        other = np.clip(curve.kv.start + curve.kv.stop - u, curve.kv.start, curve.kv.stop)
        assert abs(back(u) - curve(other)).max() <= weights * (reach + 20 * curve.kv.degree * EPS)
        assert np.allclose(back.reverse().coefficients, curve.coefficients, rtol=1e-14, atol=0)


def test_a_surface_is_reversed_in_u_and_in_v():
    u, v = np.linspace(0, 1, 5), np.linspace(0, 1, 4)
    for back, other in (
        (BALL.reverse(), BALL.grid(1 - u, v)),
        (BALL.reverse(1), BALL.grid(u, 1 - v)),
    ):
        assert np.allclose(back.grid(u, v), other, rtol=0, atol=1e-14)


@given(curves(), st.data())
def test_pieces_finer_and_higher_curves_are_the_same_curve(curve, data):
    kv, u = curve.kv, data.draw(parameters(curve.kv))
    middles = kv.breaks[:-1] + np.diff(kv.breaks) / 2
    bound = 60 * (kv.degree + 2) * EPS
    for other in (curve.insert(middles), curve.elevate(kv.degree + 2), curve.clamp()):
        assert abs(other(u) - curve(u)).max() <= bound
    if u.min() < u.max():
        assert abs(curve.segment((u.min(), u.max()))(u) - curve(u)).max() <= bound
    assert curve.elevate(1).kv.degree == kv.degree


def test_equal_weights_make_polynomial_splines_and_others_do_not():
    curve = BSplineCurve(CUBIC, np.random.default_rng(1).normal(size=(7, 2)))
    assert (NURBSCurve(CUBIC, curve.coefficients, 3.0).to_bspline().coefficients == curve.coefficients).all()
    assert (NURBSCurve.from_bspline(curve).to_bspline().coefficients == curve.coefficients).all()
    surface = BSplineSurface(CUBIC, CUBIC, np.random.default_rng(1).normal(size=(7, 7, 3)))
    assert (NURBSSurface.from_bspline(surface).to_bspline().coefficients == surface.coefficients).all()
    with pytest.raises(ValueError, match=r"all weights are equal, got 0\.5 to 1"):
        circular_arc(1.0).to_bspline()


def test_a_pose_moves_every_class():
    pose = Pose.at((1.0, 2.0, 3.0), (0.3, -0.2, 0.9))
    rng, u = np.random.default_rng(2), np.linspace(0, 1, 6)
    space = THBSpace(CUBIC, CUBIC).refine({0: [(0, 0), (1, 1)]})
    for spline in (
        BSplineCurve(CUBIC, rng.normal(size=(7, 3))),
        circular_arc(2.0).transform([[1, 0], [0, 1], [0, 0]]),
        BSplineSurface(CUBIC, CUBIC, rng.normal(size=(7, 7, 3))),
        BALL,
        THBSurface(space, rng.normal(size=(space.dim, 3))),
    ):
        parameters = (u,) if hasattr(spline, "kv") else (u, u)
        moved = spline.transform(pose.rotation, pose.shift)
        assert np.allclose(moved(*parameters), pose.points(spline(*parameters).T).T, rtol=0, atol=1e-13)
    for spline in (BSplineCurve(CUBIC, np.ones(7)), THBSurface(space, np.ones(space.dim))):
        with pytest.raises(ValueError, match="needs points"):
            spline.transform(np.eye(1))


# ---- nets and integrals of THB surfaces ----


def test_a_full_net_is_taken_over_a_tensor_product_space():
    space, rng = THBSpace(CUBIC, KnotVector.uniform(2, 3)), np.random.default_rng(3)
    for net in (rng.normal(size=(7, 5)), rng.normal(size=(7, 5, 3))):
        surface = THBSurface(space, net)
        assert (surface.to_bspline().coefficients == net).all()
        assert surface.coefficients.shape == (35, *net.shape[2:])
    finer = space.refine({0: [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)]})
    with pytest.raises(ValueError, match="coefficients must have shape"):
        THBSurface(finer, np.ones((7, 5)))


@examples(20)
@given(st.data())
def test_integral_and_area_of_a_thb_surface_are_those_of_its_bspline(data):
    space, _ = data.draw(refined_spaces((data.draw(tensor_spaces(max_spans=3)), [])))
    rng = data.draw(seeds())
    surface = THBSurface(space, rng.uniform(-1, 1, (space.dim, 3)))
    flat = surface.to_bspline()
    size = np.prod([kv.stop - kv.start for kv in flat.knot_vectors])
    assert np.allclose(surface.integral(), flat.integral(), rtol=0, atol=1e-13 * size)
    graph = THBSurface(space, surface.coefficients[:, 0])
    (found, error), (other, rest) = graph.area(), graph.to_bspline().area()
    assert abs(found - other) <= error + rest + 1e-12 * found


# ---- length, area, normal ----


def test_lengths_and_areas_are_those_of_closed_forms_and_of_adaptive_quadrature():
    curve = BSplineCurve(CUBIC, np.random.default_rng(4).normal(size=(7, 3)))
    parts = [quad(lambda u: np.linalg.norm(curve([u], 1)), a, b, epsabs=1e-13)[0] for a, b in CUBIC_SPANS]
    graph = BSplineCurve(KnotVector.uniform(2, 1), [0.0, 0.0, 1.0])  # y = u^2
    quarter_cone = revolved(line([3.0, 0.0], [0.0, 4.0]), np.pi / 2)
    pairs = [
        (curve.arc_length(), sum(parts)),
        (graph.arc_length(), np.sqrt(5) / 2 + np.arcsinh(2) / 4),
        (circular_arc(2.0).arc_length(), 4 * np.pi),
        (BALL.area(), 100 * np.pi),
        (quarter_cone.area(), np.pi / 4 * 3 * 5),
        (BSplineSurface(CUBIC, CUBIC, CUBIC.greville()[:, None] + CUBIC.greville()).area(), np.sqrt(3)),
        (
            BSplineSurface(CUBIC, CUBIC, np.dstack(np.meshgrid(CUBIC.greville(), CUBIC.greville()))).area(),
            1.0,
        ),
    ]
    for (value, error), wanted in pairs:
        assert abs(value - wanted) <= error + 1e-14 * wanted
        assert error <= 1e-5 * wanted


CUBIC_SPANS = list(zip(CUBIC.breaks[:-1], CUBIC.breaks[1:]))


def test_normals_of_a_sphere_a_graph_and_a_thb_graph():
    u, v = np.random.default_rng(5).uniform(0.1, 0.9, (2, 20))
    radial = BALL(u, v) / 5
    found = BALL.normal(u, v)
    assert np.allclose(found * np.sign((found * radial).sum(axis=1))[:, None], radial, rtol=0, atol=1e-13)
    net = CUBIC.greville()[:, None] ** 1 * 2 - 3 * CUBIC.greville()
    for graph in (BSplineSurface(CUBIC, CUBIC, net), THBSurface(THBSpace(CUBIC, CUBIC), net)):
        assert np.allclose(graph.normal(u, v), np.array([-2, 3, 1]) / np.sqrt(14), rtol=0, atol=1e-13)
    cone = revolved(line([0.0, 0.0], [3.0, 4.0]))
    assert np.isnan(cone.normal([0.0], [0.3])).all()  # the apex has none
    with pytest.raises(ValueError, match="3 components"):
        BSplineSurface(CUBIC, CUBIC, np.zeros((7, 7, 2))).normal([0.5], [0.5])


# ---- closest points ----


@examples(20)
@given(curves(), nurbs_curves(d=2, max_degree=4, max_spans=4), seeds())
def test_no_point_of_a_dense_sample_of_a_curve_is_nearer(polynomial, rational, rng):
    for curve in (polynomial, rational):
        u = np.linspace(curve.kv.start, curve.kv.stop, 2001)
        if curve.is_scalar:
            with pytest.raises(ValueError, match="needs a spline of points"):
                curve.closest_point([[0.0, 1.0]])
            continue
        samples = curve(u)
        x = rng.uniform(-2, 2, (5, samples.shape[1]))
        found = curve.closest_point(x)
        assert (found.distances <= cKDTree(samples).query(x)[0] + found.errors + 1e-12).all()
        at = curve(found.parameters)
        assert np.allclose(at, found.points, rtol=0, atol=1e-14)
        assert np.allclose(np.linalg.norm(x - at, axis=1), found.distances, rtol=0, atol=1e-13)


@pytest.mark.slow
@examples(8)
@given(nurbs_surfaces(max_degree=3, max_spans=2), seeds())
def test_no_point_of_a_dense_sample_of_a_surface_is_nearer(surface, rng):
    x = rng.uniform(-2, 2, (4, 3))
    found = surface.closest_point(x)
    grids = [np.linspace(kv.start, kv.stop, 101) for kv in surface.knot_vectors]
    nearest = cKDTree(surface.grid(*grids).reshape(-1, 3)).query(x)[0]
    assert (found.distances <= nearest + found.errors + 1e-12).all()
    assert np.allclose(surface(*found.parameters.T), found.points, rtol=0, atol=1e-13)


def test_closest_points_of_circle_and_sphere_and_of_their_centres():
    rng = np.random.default_rng(6)
    for spline, radius, d in ((circular_arc(2.0), 2.0, 2), (BALL, 5.0, 3)):
        x = rng.normal(size=(20, d)) * radius
        x[0] = 0.0
        found = spline.closest_point(x, tolerance=1e-10)
        assert np.allclose(found.distances, abs(np.linalg.norm(x, axis=1) - radius), rtol=0, atol=1e-10)
        assert np.allclose(
            found.points[1:], radius * x[1:] / np.linalg.norm(x[1:], axis=1)[:, None], atol=1e-7
        )
        assert (found.errors == 1e-10).all()
        again = spline.closest_point(found.points)
        assert again.distances.max() <= 1e-14 * radius


def test_the_parameters_are_accurate_to_rounding_where_the_curve_bends_away():
    """Newton's method ends there: points are on normals.  The distance alone tells a parameter to 1e-8."""
    curve = BSplineCurve(CUBIC, [[0, 0], [1, 0], [2, 2], [3, 0], [4, 1], [5, 1], [6, 0]])
    x = np.random.default_rng(10).uniform(0, 6, (50, 2))
    found = curve.closest_point(x)
    inner = (found.parameters > 0) & (found.parameters < 1)
    slopes = ((found.points - x) * curve(found.parameters, 1)).sum(axis=1)
    assert inner.sum() > 30
    assert abs(slopes[inner]).max() <= 1e-12  # sizes of some 5 times 20, with a few roundings


def test_a_tolerance_below_rounding_ends_with_an_error_of_rounding():
    """From the centre all cells of a circle are as near, but for rounding: none can be left out."""
    found = circular_arc(2.0).closest_point(np.zeros((1, 2)), tolerance=0.0)
    assert 0 <= found.errors[0] <= 10 * EPS
    assert found.distances[0] == pytest.approx(2.0, abs=10 * EPS)


def test_closest_points_of_a_thb_surface_are_those_of_its_bspline():
    space = THBSpace(CUBIC, CUBIC).refine({0: [(i, j) for i in (0, 1) for j in (0, 1)]})
    rng = np.random.default_rng(7)
    x = rng.uniform(0, 1, (6, 3))
    surface = THBSurface(space, rng.uniform(0, 1, (space.dim, 3)))
    found, other = (s.closest_point(x, 1e-9) for s in (surface, surface.to_bspline()))
    assert abs(found.distances - other.distances).max() <= 2e-9


@pytest.mark.parametrize(
    ("points", "tolerance", "message"),
    [
        ([0.0, 1.0, 2.0], None, r"points must be finite and have shape \(n, 2\)"),
        ([[0.0, np.nan]], None, "points must be finite"),
        ([[0.0, 1.0]], -1.0, "tolerance must be a number of at least 0"),
    ],
)
def test_points_and_tolerances_are_refused(points, tolerance, message):
    with pytest.raises(ValueError, match=message):
        circular_arc(1.0).closest_point(points, tolerance)


def test_one_point_has_one_closest_point():
    one, many = (circular_arc(1.0).closest_point(x) for x in ([3.0, 1.0], [[3.0, 1.0]]))
    for name in ("parameters", "points", "distances", "errors"):
        assert np.array_equal(getattr(one, name), getattr(many, name)[0])


def test_as_many_arguments_as_directions_are_wanted():
    curve = BSplineCurve(CUBIC, np.ones((7, 2)))
    for call in (lambda: curve.insert([0.3], [0.4]), lambda: BALL.elevate(3), curve.derivative):
        with pytest.raises(ValueError, match="a direction takes one argument"):
            call()
    with pytest.raises(ValueError, match=r"directions must be from 0 to 0, got \(1,\)"):
        curve.reverse(1)


def test_no_points_have_no_closest_ones():
    assert circular_arc(1.0).closest_point(np.zeros((0, 2))).points.shape == (0, 2)
