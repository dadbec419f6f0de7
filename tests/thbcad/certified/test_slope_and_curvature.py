"""Certified slopes and radii of curvature against closed forms, dense samples of scipy, OCCT and convergence
rates."""

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from tests.cases import examples
from tests.thbcad.cases import coefficients, scipy_twin, spaces
from tests.thbcad.certified.cases import assert_it_falls_with_the_square_of_the_cell_size, graphs
from thbcad.certified.slope_and_curvature import greatest_slope, least_radii
from thbcad.sags import Conic, conic_graph, graph_poles, square_coefficients
from thbcad.splines import BSplineSurface, KnotVector, interpolate
from thbcad.surfaces import THBSurface


def samples(graph, u, v):
    """Return slopes and principal curvatures (least first) at scattered points, by scipy and numpy alone."""
    spline = scipy_twin(graph)
    z_x, z_y, z_xx, z_xy, z_yy = (
        spline(np.column_stack([u, v]), nu=nu) for nu in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    )
    w = np.sqrt(1 + z_x**2 + z_y**2)
    first = np.array([[1 + z_x**2, z_x * z_y], [z_x * z_y, 1 + z_y**2]])
    second = np.array([[z_xx, z_xy], [z_xy, z_yy]]) / w
    shape = np.linalg.solve(first.transpose(2, 0, 1), second.transpose(2, 0, 1))
    return np.hypot(z_x, z_y), np.sort(np.linalg.eigvals(shape).real, axis=1)


def inside(kv, shares):
    return kv.start + (kv.stop - kv.start) * shares


def quadric(a, b, kv_x, kv_y):
    """z = a x^2 + b y^2; exact in float64 for knots and factors of few bits."""
    return BSplineSurface(kv_x, kv_y, a * square_coefficients(kv_x)[:, None] + b * square_coefficients(kv_y))


@pytest.mark.parametrize("degree", [2, 3, 5])
@pytest.mark.parametrize("radius", [8.0, -8.0])
def test_the_vertex_of_a_paraboloid(degree, radius):
    kv = KnotVector.uniform(2, 3, -3, 3)
    radii = least_radii(quadric(0.5 / radius, 0.5 / radius, kv, kv).elevate(degree, degree))
    least, none = (radii.concave, radii.convex) if radius > 0 else (radii.convex, radii.concave)
    assert least.lower <= 8 * (1 + 1e-14)  # degree elevation rounds
    assert least.upper >= 8 * (1 - 1e-14)
    assert least.lower <= least.value <= least.upper <= least.lower * (1 + 2e-6)
    assert np.hypot(least.u, least.v) < 0.02  # 1/k = R (1 + r^2 / 2R^2): 1e-6 of it is r = 0.011
    assert none.value == none.upper == np.inf
    assert none.lower == np.inf


def test_a_paraboloid_beside_its_vertex():
    """Of the principal curvatures 1 / (R W) and 1 / (R W^3) the first is greater, most at the corner next to
    the vertex."""
    graph = quadric(1 / 16, 1 / 16, KnotVector.uniform(2, 3, 2, 5), KnotVector.uniform(2, 2, 4, 6))
    found = least_radii(graph).concave
    wanted = 8 * np.sqrt(1 + 20 / 64)
    assert found.lower <= wanted <= found.upper * (1 + 1e-15)
    assert (found.u, found.v) == (2, 4)
    assert found.value == pytest.approx(wanted, rel=1e-14)


def test_a_saddle_bends_both_ways():
    kv = KnotVector.uniform(2, 3, -1, 1)
    radii = least_radii(quadric(1 / 8, -1 / 32, kv, kv))
    for found, radius in ((radii.concave, 4), (radii.convex, 16)):
        assert found.lower <= radius <= found.upper <= found.lower * (1 + 2e-6)


def test_a_cylinder_is_steepest_curved_away_from_the_knots():
    """z = x^3: k = 6 x / (1 + 9 x^4)^(3/2) is greatest at x^4 = 1/45, and odd."""
    kv = KnotVector.uniform(3, 2, -1, 1)
    cubes = kv.knots[1:-3] * kv.knots[2:-2] * kv.knots[3:-1]
    radii = least_radii(BSplineSurface(kv, KnotVector.uniform(2, 3), np.outer(cubes, np.ones(5))))
    wanted = 1.2**1.5 / 6 * 45**0.25
    for found, sign in ((radii.concave, 1), (radii.convex, -1)):
        assert found.lower <= wanted <= found.upper <= found.lower * (1 + 2e-6)
        assert found.u == pytest.approx(sign * 45**-0.25, abs=1e-3)


def test_both_sides_of_a_jump_count():
    """z = max(x, 0)^2 has curvature 0 on the left of x = 0 and 2 on the right."""
    graph = BSplineSurface(
        KnotVector(2, [-1, -1, -1, 0, 1, 1, 1]), KnotVector.uniform(2, 1), np.outer([0, 0, 0, 1], np.ones(3))
    )
    found = least_radii(graph).concave
    assert found.lower <= 0.5 <= found.upper <= 0.5 * (1 + 2e-6)
    assert found.u == 0


@pytest.mark.slow
def test_a_sphere():
    """Here every cell holds nearly the greatest curvature.  The spline is the sphere to 1e-11 mm, so that its
    second derivatives err by about 8 p^2 / h^2 times that, h its mesh size."""
    kv = KnotVector.uniform(4, 8, -5, 5)
    graph = conic_graph(Conic(30, 0), kv, kv)
    radii = least_radii(graph)
    mesh = np.diff(graph.kv_u.breaks).min()
    slack = 30 * 8 * 16 / mesh**2 * 1e-11 + 1e-5  # the search ends before 1e-6
    assert 30 * (1 - slack) <= radii.concave.lower <= radii.concave.upper <= 30 * (1 + slack)
    assert radii.convex.value == np.inf


def test_planes_have_no_radius():
    kv = KnotVector.uniform(3, 4, -2, 2)
    x = kv.greville()
    for heights, exact in ((np.full((7, 7), 0.3), True), (0.5 * x[:, None] + 0.25 * x, False)):
        radii = least_radii(BSplineSurface(kv, kv, heights))
        for found in (radii.concave, radii.convex):
            assert found.upper == np.inf
            # a constant is a plane in float64 too, another plane but for rounding
            assert found.lower == np.inf if exact else found.lower > 1e12
    slope = greatest_slope(BSplineSurface(kv, kv, 0.5 * x[:, None] + 0.25 * x))
    assert slope.lower <= np.sqrt(0.3125) <= slope.upper <= slope.lower + 1e-13


def test_the_slope_of_a_paraboloid():
    found = greatest_slope(
        quadric(1 / 16, 1 / 4, KnotVector.uniform(3, 3, -3, 2), KnotVector.uniform(2, 2, -1, 1))
    )
    assert found.lower <= np.hypot(3 / 8, 1 / 2) <= found.upper <= found.lower + 1e-13
    assert (found.u, abs(found.v)) == (-3, 1)


@given(graphs(min_degree=1, max_degree=5, max_spans=4), st.integers(0, 2**32 - 1))
def test_no_sample_is_steeper(graph, seed):
    shares = np.random.default_rng(seed).random((2, 200))
    spline = scipy_twin(graph)
    points = np.column_stack([inside(kv, s) for kv, s in zip((graph.kv_u, graph.kv_v), shares)])
    slopes = np.hypot(spline(points, nu=(1, 0)), spline(points, nu=(0, 1)))
    found = greatest_slope(graph)
    # about 10 p roundings of terms below 2 p / h, with coefficients below 1
    noise = 1e-14 * sum(kv.degree**2 / np.diff(kv.breaks).min() for kv in (graph.kv_u, graph.kv_v))
    assert slopes.max() <= found.upper + noise
    assert 0 <= found.lower <= found.value <= found.upper <= found.lower * (1 + 2e-9) + noise


@examples(80)
@given(graphs(min_degree=2, max_degree=4, max_spans=4, scales=(1.0, 25.4)), st.integers(0, 2**32 - 1))
def test_no_sample_is_more_curved(graph, seed):
    """Random surfaces, with creases at knots of multiplicity p; the enclosures are as narrow as asked."""
    shares = np.random.default_rng(seed).random((2, 400))
    _, k = samples(graph, *(inside(kv, s) for kv, s in zip((graph.kv_u, graph.kv_v), shares)))
    radii = least_radii(graph)
    # all spans are 1 or longer: second derivatives are below 4 p^2, and slopes below 2 p make eigenvalues 1 +
    # 8 p^2 times less accurate
    noise = 1e-15 * 64 * 129
    for found, greatest in ((radii.concave, k.max()), (radii.convex, -k.min())):
        assert greatest <= 1 / found.lower + noise
        assert found.lower <= found.value <= found.upper
        assert 1 / found.lower - 1 / found.upper <= 2e-6 / found.lower + noise


@given(graphs(min_degree=3, max_degree=5, max_spans=3, scales=(1.0,)))
def test_the_place_has_the_radius(graph):
    """The second derivatives are continuous where no knot is repeated more than p - 2 times."""
    counts = [
        np.unique(kv.knots, return_counts=True)[1][1:-1].max(initial=0) for kv in (graph.kv_u, graph.kv_v)
    ]
    assume(all(count <= kv.degree - 2 for count, kv in zip(counts, (graph.kv_u, graph.kv_v))))
    radii = least_radii(graph)
    _, k = samples(graph, [radii.concave.u, radii.convex.u], [radii.concave.v, radii.convex.v])
    noise = 1e-15 * 64 * 129  # as above
    assert max(k[0, 1], 0) == pytest.approx(1 / radii.concave.value, abs=noise)
    assert max(-k[1, 0], 0) == pytest.approx(1 / radii.convex.value, abs=noise)


def test_occt_sees_the_same_curvature():
    """An independent referee: GeomLProp at the places that were found, and at scattered points."""
    from OCP.GeomLProp import GeomLProp_SLProps

    from thbcad.cad.shapes import geom_surface

    kv = KnotVector.uniform(3, 6, -2, 2)
    wave = interpolate(kv, kv, lambda x, y: 0.2 * np.sin(1.7 * x + 0.3) * np.cos(1.3 * y - 0.2) + 0.05 * x**2)
    geom = geom_surface(graph_poles(wave, 0.0, wave))

    def curvatures(u, v):
        properties = GeomLProp_SLProps(geom, float(u), float(v), 2, 1e-12)
        assert properties.IsCurvatureDefined()  # OCCT 8.0 computes them then
        return sorted([properties.MinCurvature(), properties.MaxCurvature()])

    radii = least_radii(wave)
    # the sign of OCCT's curvature depends on its normal, which points to +z here
    assert abs(curvatures(radii.concave.u, radii.concave.v)[1]) == pytest.approx(
        1 / radii.concave.value, rel=1e-12
    )
    assert abs(curvatures(radii.convex.u, radii.convex.v)[0]) == pytest.approx(
        1 / radii.convex.value, rel=1e-12
    )
    seen = np.array([curvatures(u, v) for u, v in np.random.default_rng(0).uniform(-2, 2, (500, 2))])
    assert seen.max() <= 1 / radii.concave.lower
    assert -seen.min() <= 1 / radii.convex.lower


@pytest.mark.every(3)
@pytest.mark.parametrize("quantity", ["slope", "concave", "convex"])
def test_bounds_tighten_with_the_square_of_the_cell_size(quantity):
    """With a huge tolerance the search ends at the given cells: their bounds err by O(h^2)."""
    kv = KnotVector.uniform(4, 8, -2, 2)
    wave = interpolate(kv, kv, lambda x, y: np.sin(1.7 * x + 0.3) * np.cos(1.3 * y - 0.2))

    def greatest(graph, tolerance):
        if quantity == "slope":
            found = greatest_slope(graph, tolerance)
            return found.value, found.upper
        found = getattr(least_radii(graph, tolerance), quantity)
        return 1 / found.value, 1 / found.lower

    true, _ = greatest(wave, 1e-10)
    assert_it_falls_with_the_square_of_the_cell_size(lambda graph: greatest(graph, 1e9)[1] - true, wave)


@pytest.mark.slow
@examples(20)
@given(st.data())
def test_thb_surfaces_and_their_patches_have_the_same_radii(data):
    space = data.draw(spaces(max_steps=3).filter(lambda s: min(s.kv_u.degree, s.kv_v.degree) > 1))
    surface = THBSurface(space, data.draw(coefficients(space.dim)))
    for quantity in (greatest_slope, lambda g: least_radii(g).concave, lambda g: least_radii(g).convex):
        a, b = quantity(surface), quantity(surface.to_patches())
        # both enclose the same number, but the coefficients of the patches are rounded: 1e-10 is far above
        # that
        assert max(a.lower, b.lower) <= min(a.upper, b.upper) * (1 + 1e-10) + 1e-10


@pytest.mark.parametrize("degrees", [(1, 3), (3, 1), (1, 1)])
def test_degree_1_has_no_curvature(degrees):
    kvs = [KnotVector.uniform(p, 2) for p in degrees]
    with pytest.raises(
        ValueError,
        match=rf"curvature needs degree 2 or more in x and y, got degrees \({degrees[0]}, {degrees[1]}\)",
    ):
        least_radii(BSplineSurface(*kvs, np.zeros([kv.dim for kv in kvs])))


def test_steep_and_flat_stay_numbers():
    """Slopes from 1e-300 to 1e12: bounds are never NaN and always in order."""
    kv = KnotVector.uniform(3, 3)
    net = np.random.default_rng(0).normal(size=(6, 6))
    for scale in (1e-300, 1e-150, 1e-20, 1.0, 1e4, 1e12):
        graph = BSplineSurface(kv, kv, scale * net)
        radii = least_radii(graph)
        for found in (radii.concave, radii.convex, greatest_slope(graph)):
            assert 0 <= found.lower <= found.value <= found.upper
