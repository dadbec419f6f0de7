"""Conics, freeform surfaces, their spline graphs, and the closed lens."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from scipy.interpolate import NdBSpline
from scipy.spatial import ConvexHull

from oracles.spline_definitions import flux_volume, gamma
from tests.thbcad.cases import lenses, surfaces
from thbcad.hierarchy import THBSpace
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.lens import Lens
from thbcad.lens.soundness import require_sound
from thbcad.sags import CONIC_TOLERANCE, Conic, square_coefficients
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

EPS = np.finfo(float).eps
X, Y = (a.ravel() for a in np.meshgrid(np.linspace(-5, 5, 21), np.linspace(-4, 4, 17)))
R2 = X * X + Y * Y


def flat_sag(value=0.0, degree=3, spans=4):
    kv = KnotVector.uniform(degree, spans)
    space = THBSpace(kv, kv)
    return THBSurface(space, np.full(space.dim, value))


def wavy_surface(degree=3):
    """A conic with a THB sag over [0, 1] x [-2, 3], refined in a corner, on 5 mm x 4 mm."""
    space = THBSpace(KnotVector.uniform(degree, 4), KnotVector.uniform(degree, 5, -2, 3))
    space = space.refine({0: [(i, j) for i in range(4) for j in range(4)]}).refine(
        {1: [(i, j) for i in range(4) for j in range(5)]}
    )
    return FreeformSurface((5, 4), Conic(40, -0.5), THBSurface(space, np.sin(np.arange(space.dim))))


def plano(rear, thickness=5.0):
    return Lens(FreeformSurface(rear.half_width), rear, thickness, 1.5)


# ---- conics ----


@pytest.mark.parametrize("radius", [8.0, -8.0, 30.0, -1e4])
@pytest.mark.parametrize("constant", [0.0, 0.3, -0.5, -2.0, -10.0])
def test_conic_against_the_quadratic_formula(radius, constant):
    """(1 + K) z^2 - 2 R z + r^2 = 0, the root at the vertex; exact to the cancellation in that formula."""
    q = 1 + constant
    want = radius / q * (1 - np.sqrt(1 - q * R2 / radius**2))
    assert abs(Conic(radius, constant)(X, Y) - want).max() <= 8 * EPS * abs(radius / q)


def test_sphere_paraboloid_plane_hyperbola():
    assert Conic(5.0)(3.0, 0.0) == pytest.approx(1.0, rel=4 * EPS)
    assert Conic(-5.0)(0.0, 3.0) == pytest.approx(-1.0, rel=4 * EPS)
    assert abs(Conic(7.0, -1.0)(X, Y) - R2 / 14).max() <= 4 * EPS * R2.max() / 14
    assert (Conic()(X, Y) == 0).all()
    assert (Conic(-np.inf, 5.0)(X, Y) == 0).all()
    # hyperbola with K = -2: (z + R)^2 = R^2 + r^2
    assert Conic(3.0, -2.0)(4.0, 0.0) == pytest.approx(2.0, rel=4 * EPS)


@given(st.floats(0.1, 1e6), st.booleans(), st.floats(-20, 5), st.floats(0, 1), st.floats(0, 1))
def test_conic_satisfies_its_equation(radius, negative, constant, x, y):
    """The residual of r^2 - 2 R z + (1 + K) z^2 in exact arithmetic; near the vertex the sag keeps its
    relative accuracy."""
    x, y = 0.5 * x * radius, 0.5 * y * radius
    q = Fraction(1 + constant)
    r2 = Fraction(x) ** 2 + Fraction(y) ** 2
    assume(q * r2 <= Fraction(9, 10) * Fraction(radius) ** 2)
    z = Fraction(float(Conic(-radius if negative else radius, constant)(x, y))) * (-1 if negative else 1)
    assert z >= 0
    residual = abs(r2 - 2 * Fraction(radius) * z + q * z * z)
    # roundings: the argument of the root loses up to 1 / (1 - 0.9) in relative accuracy; x^2 may be subnormal
    assert residual <= (Fraction(1, 10**300) if r2 < Fraction(1, 10**280) else 400 * Fraction(EPS) * r2)


@pytest.mark.parametrize(
    "conic", [Conic(9.0), Conic(-9.0, 0.4), Conic(12.0, -1.0), Conic(-7.0, -3.0), Conic()]
)
def test_conic_slopes_by_the_complex_step(conic):
    h = 1e-30
    assert np.allclose(conic(X, Y, (1, 0)), conic(X + 1j * h, Y).imag / h, rtol=20 * EPS, atol=20 * EPS)
    assert np.allclose(conic(X, Y, (0, 1)), conic(X, Y + 1j * h).imag / h, rtol=20 * EPS, atol=20 * EPS)


@pytest.mark.parametrize("derivative", [(-1, 0), (0, 1.5), (True, 2)])
def test_orders_that_are_no_counts_are_refused(derivative):
    with pytest.raises(ValueError, match="derivative must be a non-negative integer, got"):
        Conic(50.0)(X, Y, derivative)


@pytest.mark.parametrize("radius", [0, 0.0, -0.0, np.nan, None, "a"])
def test_radius_is_refused(radius):
    with pytest.raises(ValueError, match=r"radius must be a number( other than 0)?, got"):
        Conic(radius)


@pytest.mark.parametrize("constant", [np.nan, np.inf, -np.inf])
def test_conic_constant_is_refused(constant):
    with pytest.raises(ValueError, match="conic constant must be a finite number"):
        Conic(5.0, constant)


def test_kinds_of_conic():
    assert Conic().is_plane
    assert Conic(np.inf, 3.0).is_paraboloid
    assert Conic(5.0, -1.0).is_paraboloid
    assert not Conic(5.0, -1.0).is_plane
    assert not Conic(5.0, 0.0).is_paraboloid


@pytest.mark.parametrize("radius", [5.0, -5.0])
def test_conics_that_end_inside_the_aperture_are_refused(radius):
    with pytest.raises(
        ValueError, match=r"ends at r = 5 mm, but the corner of the aperture lies at r = 5 mm"
    ):
        FreeformSurface((3, 4), Conic(radius, 0.0))
    with pytest.raises(ValueError, match=r"\(radius -?5\.0, K 3\.0\) ends at r = 2\.5 mm"):
        FreeformSurface((3, 4), Conic(radius, 3.0))
    for constant in (-1e-9, -1.0, -30.0):
        FreeformSurface((3, 4), Conic(radius, constant))


# ---- freeform surfaces ----


@pytest.mark.parametrize(
    "half_width", [(5,), (5, 5, 5), (0, 5), (5, -1), (np.nan, 5), (5, np.inf), None, (5, "a"), 5]
)
def test_half_width_is_refused(half_width):
    with pytest.raises(ValueError, match="half_width must be two positive numbers"):
        FreeformSurface(half_width)


def test_vector_sag_is_refused():
    space = flat_sag().space
    with pytest.raises(ValueError, match="scalar coefficients"):
        FreeformSurface((5, 5), Conic(), THBSurface(space, np.zeros((space.dim, 1))))


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_value_and_slopes_against_scipy(degree):
    """Conic in closed form plus the sag by NdBSpline with its knots mapped to mm."""
    surface = wavy_surface(degree)
    sag = surface.sag.to_bspline()
    t_x, t_y = 10 * sag.kv_u.knots - 5, (sag.kv_v.knots + 2) * 8 / 5 - 4
    twin = NdBSpline((t_x, t_y), sag.coefficients, degree)
    points = np.stack([np.clip(X, t_x[0], t_x[-1]), np.clip(Y, t_y[0], t_y[-1])], axis=-1)
    for order in [(0, 0), (1, 0), (0, 1)]:
        want = Conic(40, -0.5)(X, Y, order) + twin(points, nu=order)
        # the mapped knots carry errors of eps * 5 mm; the finest span is 10 / 16 mm wide
        slope = (2 * degree / (10 / 16)) ** (1 + sum(order))
        assert abs(surface(X, Y, order) - want).max() <= 40 * degree * EPS * (1 + 5 * slope)
        grid = surface.grid(np.unique(X), np.unique(Y), order)
        assert abs(grid.T.ravel() - want).max() <= 40 * degree * EPS * (1 + 5 * slope)


def test_slopes_by_differences():
    """Central differences converge with the square of the step."""
    surface = wavy_surface()
    x, y = np.array([0.31, -2.2, 4.1]), np.array([-3.3, 1.7, 0.2])
    errors = []
    for h in (1e-2, 1e-3):
        by_x = (surface(x + h, y) - surface(x - h, y)) / (2 * h)
        by_y = (surface(x, y + h) - surface(x, y - h)) / (2 * h)
        errors.append(max(abs(by_x - surface(x, y, (1, 0))).max(), abs(by_y - surface(x, y, (0, 1))).max()))
    assert errors[1] <= errors[0] / 90


def test_the_rim_is_inside_the_domain():
    """Mapping the ends of an interval that is not representable must not leave the spline's domain."""
    for h in (0.1, 1 / 3, 47.5, 7e3):
        kv = KnotVector.uniform(3, 3, 0.1, 0.7)
        space = THBSpace(kv, kv)
        surface = FreeformSurface((h, h), Conic(), THBSurface(space, np.arange(space.dim, dtype=float)))
        corners = surface.grid([-h, h], [-h, h])
        assert np.allclose(corners, [[0, 5], [30, 35]], rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(
    ("x", "y", "message"),
    [(5.1, 0.0, "x = 5.1 mm lies outside"), (0.0, -4.1, "y = -4.1"), (np.nan, 0.0, "x = nan")],
)
def test_positions_outside_are_refused(x, y, message):
    surface = FreeformSurface((5, 4), Conic(30, -1))
    for call in (surface, surface.grid):
        with pytest.raises(ValueError, match=message):
            call([x], [y])


def test_spheres_without_a_sag_get_few_knots():
    lens = Lens(FreeformSurface((5, 5), Conic(40, 0)), FreeformSurface((5, 5), Conic(-30, 0)), 5, 1.5)
    front, rear = lens.graphs()
    assert front.kv_u.degree == rear.kv_u.degree == 5
    assert max(front.coefficients.shape + rear.coefficients.shape) < 60


def test_scalars_and_shapes():
    surface = wavy_surface()
    assert surface(1.0, 2.0).shape == (1,)
    assert surface.grid(1.0, [0.0, 2.0]).shape == (1, 2)
    assert FreeformSurface((1, 1))([0.5, 0.2], [0.1, 0.1]).tolist() == [0, 0]


def test_with_sag():
    surface = wavy_surface()
    other = surface.with_sag(THBSurface(surface.sag.space, np.ones(surface.sag.space.dim)))
    assert other.sag.space is surface.sag.space
    assert abs(other(X, Y) - surface.conic(X, Y) - 1).max() <= 20 * EPS


# ---- graphs ----


@given(st.integers(2, 10), st.integers(1, 6))
def test_square_coefficients(degree, spans):
    kv = KnotVector.uniform(degree, spans, -3.0, 5.0)
    x = np.linspace(-3, 5, 23)
    assert (
        abs(kv.collocation(x) @ square_coefficients(kv) - x * x).max()
        <= float(gamma(8 * degree + degree**2)) * 25
    )


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
@pytest.mark.parametrize("radius", [9.0, -40.0, np.inf])
def test_paraboloid_graph_is_exact(degree, radius):
    """No knots are added and the error is that of rounding."""
    graph = FreeformSurface((5, 4), Conic(radius, -1.0)).graph((degree, degree))
    assert graph.coefficients.shape == (degree + 1, degree + 1)
    assert (graph.kv_u.start, graph.kv_u.stop, graph.kv_v.start, graph.kv_v.stop) == (-5, 5, -4, 4)
    scale = 41 / (2 * abs(radius))
    assert abs(graph(X, Y) - R2 / (2 * radius)).max() <= float(gamma(20 * degree + degree**2)) * scale


@pytest.mark.parametrize(
    ("conic", "half_width", "degree"),
    [
        *(
            (conic, (5, 4), degree)
            for conic in (Conic(20.0), Conic(-9.0, 0.2), Conic(15.0, -3.0))
            for degree in (3, 5)
        ),
        (Conic(20.0), (1, 0.8), 2),
        (Conic(60.0), (12.5, 12.5), 3),
    ],
    ids=lambda x: f"R{x.radius}K{x.constant}" if isinstance(x, Conic) else str(x),
)
def test_conic_graph_is_within_its_tolerance(conic, half_width, degree):
    graph = FreeformSurface(half_width, conic).graph((degree, degree))
    x, y = (np.linspace(-h, h, 801) for h in half_width)
    assert CONIC_TOLERANCE == 1e-11
    assert abs(graph.grid(x, y) - conic(x[:, None], y[None, :])).max() <= 1e-11


@pytest.mark.parametrize("conic", [Conic(40, -1.0), Conic(40, -0.5)])
def test_graph_with_a_sag_is_the_surface(conic):
    surface = FreeformSurface((5, 4), conic, wavy_surface().sag)
    x, y = np.linspace(-5, 5, 101), np.linspace(-4, 4, 103)
    graph = surface.graph()
    assert abs(graph.grid(x, y) - surface.grid(x, y)).max() <= 2e-11
    needed = surface.sag.to_bspline()
    if conic.is_paraboloid:
        assert graph.coefficients.shape == needed.coefficients.shape
    # the knots of the sag stay knots of the graph
    mapped = 10 * needed.kv_u.breaks - 5
    assert all(abs(graph.kv_u.breaks - b).min() <= 4 * EPS * 5 for b in mapped)


@given(surfaces())
def test_graphs_of_random_surfaces(surface):
    a, b = surface.half_width
    s = np.linspace(-1, 1, 23)
    reach = np.hypot(a, b)
    error = abs(surface.graph().grid(s * a, s * b) - surface.grid(s * a, s * b)).max()
    assert error <= CONIC_TOLERANCE + 1e3 * EPS * reach


@pytest.mark.parametrize("half_width", [0.1, 0.7, 1 / 3, 10.988357457165069, 22.17813225167172])
@pytest.mark.parametrize("degree", [3, 5, 6, 7])
def test_spheres_of_any_size_have_a_graph(half_width, degree):
    """The interpolation points must not leave the domain by rounding."""
    conic = Conic(20 * half_width)
    graph = FreeformSurface((half_width, half_width), conic).graph((degree, degree))
    corner = graph.grid([-half_width, half_width], [-half_width, half_width])
    assert abs(corner - conic(half_width, half_width)).max() <= 1e-11


def test_conics_that_no_spline_of_that_size_follows_are_refused():
    with pytest.raises(
        ValueError,
        match=r"radius 5\.001 and K 0\.0 cannot be written as a spline to 1e-11 mm with 2000 control points",
    ):
        FreeformSurface((5, 1e-3), Conic(5.001)).graph()


def test_degree_one_is_refused():
    surface = FreeformSurface((5, 4), Conic(), flat_sag(degree=1))
    with pytest.raises(ValueError, match="a lens surface needs degree 2 or more"):
        surface.graph()
    with pytest.raises(ValueError, match="degree 2 or more"):
        require_sound(plano(surface))


# ---- lenses ----


@pytest.mark.parametrize("half_width", [(5, 5), (0.5, 30)])
def test_volume_of_a_slab(half_width):
    lens = plano(FreeformSurface(half_width), 2.5)
    assert lens.volume() == pytest.approx(4 * half_width[0] * half_width[1] * 2.5, rel=1e-14)


@pytest.mark.parametrize("radius", [-60.0, 25.0])
def test_volume_under_a_paraboloid(radius):
    """4 hx hy (t + (hx^2 + hy^2) / (6 R))."""
    lens = plano(FreeformSurface((5, 8), Conic(radius, -1.0)), 4.0)
    assert lens.volume() == pytest.approx(4 * 40 * (4 + 89 / (6 * radius)), rel=1e-14)


@pytest.mark.parametrize(("front", "rear"), [((5, 5), (8, 8)), ((5, 3), (2, 7)), ((4, 4), (4, 9))])
def test_volume_of_a_frustum(front, rear):
    """Plane faces of different size: the convex hull of the corners, and the prismatoid formula."""
    lens = Lens(FreeformSurface(front), FreeformSurface(rear), 3.0, 1.5)
    corners = [
        (sx * a, sy * b, z) for (a, b), z in ((front, 0.0), (rear, 3.0)) for sx in (-1, 1) for sy in (-1, 1)
    ]
    middle = (front[0] + rear[0]) * (front[1] + rear[1])
    prismatoid = 3.0 / 6 * 4 * (front[0] * front[1] + middle + rear[0] * rear[1])
    assert lens.volume() == pytest.approx(prismatoid, rel=1e-14)
    assert lens.volume() == pytest.approx(ConvexHull(corners).volume, rel=1e-13)


def test_volume_of_table_6_3():
    """Front 5 mm, R = -5; rear 8 mm, R = -10; thickness 5: the flux of (0, 0, z), by hand 16184 / 15 mm^3."""
    lens = Lens(FreeformSurface((5, 5), Conic(-5, -1)), FreeformSurface((8, 8), Conic(-10, -1)), 5.0, 1.5)
    # faces: rear 4 64 (5 - 64 / 30), front -4 25 (25 / 15); sides: half-widths 5 + 3 w, rims z = -(5^2 + x^2)
    # / 10 and so on
    rear, front = 256 * (5 - 128 / 60), -100 * 50 / 30
    rims = [2 * -(25 + 25 / 3) / 10, 2 * (5 - (64 + 64 / 3) / 20)]
    sides = -4 * 3 * ((2.5 + 0.5) * rims[0] + (2.5 + 1.0) * rims[1])
    assert lens.volume() == pytest.approx(rear - front + sides, rel=1e-14)


@settings(max_examples=25)
@given(lenses())
def test_volume_against_the_flux_through_the_faces(lens):
    """Gauss quadrature of the exact surfaces; the splines may differ from the conics by 1e-11 mm."""
    area = max(4 * h[0] * h[1] for h in (lens.front.half_width, lens.rear.half_width))
    reach = max(np.hypot(*h) for h in (lens.front.half_width, lens.rear.half_width))
    size = area * (lens.thickness + reach)
    assert abs(lens.volume() - flux_volume(lens)) <= 2 * CONIC_TOLERANCE * area + 1e4 * EPS * size


def test_least_thickness_at_a_corner_and_at_the_centre():
    least = plano(FreeformSurface((3, 4), Conic(-10, -1)), 2.0).least_thickness()
    assert least.value == pytest.approx(2 - 25 / 20, rel=1e-14)
    assert least.lower == pytest.approx(least.value, abs=1e-11)
    assert (abs(least.u), abs(least.v)) == (3, 4)
    least = plano(FreeformSurface((3, 4), Conic(10, -1)), 2.0).least_thickness()
    assert least.lower <= 2 <= least.value
    assert least.value == pytest.approx(least.lower, abs=1e-11)
    assert np.hypot(least.u, least.v) < 1e-5


def test_least_thickness_between_points_of_equal_relative_position():
    lens = Lens(FreeformSurface((5, 5), Conic(-5, -1)), FreeformSurface((8, 8), Conic(-10, -1)), 5.0, 1.5)
    # 5 - 64 / 10 + 25 / 5 in the corners, 5 in the middle, in between 5 + s^2 (5 - 6.4)
    assert lens.least_thickness().value == pytest.approx(3.6, rel=1e-14)


def test_surfaces_that_cross_are_refused_with_place_and_amount():
    rear = FreeformSurface((3, 4), Conic(-10, -1))
    with pytest.raises(
        ValueError,
        match=r"cross: at x = -?3, y = -?4 mm the rear lies 0\.25 mm before the front.*by more than 0\.25 mm",
    ):
        require_sound(plano(rear, 1.0))
    front = FreeformSurface((3, 4), Conic(50, -1), flat_sag(0.5))
    with pytest.raises(ValueError, match=r"cross: at x = 0, y = 0 mm the rear lies 0\.3 mm before the front"):
        require_sound(Lens(front, FreeformSurface((3, 4), Conic(10, -1)), 0.2, 1.5))


def test_surfaces_that_touch_are_refused():
    with pytest.raises(ValueError, match=r"(cross|touch).* at x = -?5, y = -?5 mm") as caught:
        require_sound(plano(FreeformSurface((5, 5), Conic(-5, -1)), 5.0))
    assert "-0 mm" not in str(caught.value)


def test_no_thickness_at_a_rim_is_told_by_its_name():
    """A plane front and a tilted rear, z = x / 5 + T: they meet at x = -5 for T = 1."""
    kv = KnotVector.uniform(2, 1)
    tilt = THBSurface(THBSpace(kv, kv), np.repeat([0.0, 1.0, 2.0], 3))
    with pytest.raises(
        ValueError,
        match=r"^the rims touch: at x = -5, y = \S+ mm the lens has no thickness at its edges -x( and "
        r"[+-]y)?; raise",
    ):
        require_sound(
            plano(FreeformSurface((5, 4), Conic(), THBSurface(tilt.space, tilt.coefficients - 1)), 1.0)
        )
    with pytest.raises(
        ValueError,
        match=r"cross: at x = -5, y = \S+ mm the rear lies 0\.5 mm before the front, at the edges -x( and "
        r"[+-]y)?; raise",
    ):
        require_sound(
            plano(FreeformSurface((5, 4), Conic(), THBSurface(tilt.space, tilt.coefficients - 1)), 0.5)
        )


def test_surfaces_that_cross_between_samples_are_refused():
    """A tilted paraboloid whose lowest point, -0.156 mm at x = -1.25, lies between quarter points of its one
    span."""
    kv = KnotVector.uniform(3, 1)
    tilt = THBSurface(THBSpace(kv, kv), np.repeat(0.25 * (10 * kv.greville() - 5), 4))
    rear = FreeformSurface((5, 5), Conic(5, -1), tilt)
    assert rear([-1.25], [0.0])[0] == pytest.approx(-0.15625, rel=1e-12)
    with pytest.raises(ValueError, match="cross"):
        require_sound(plano(rear, 0.1))


@pytest.mark.parametrize("index", [1.0, 0.5, -1.5, np.nan, np.inf, None])
def test_index_is_refused(index):
    with pytest.raises(ValueError, match="index must be a finite number greater than 1, got"):
        Lens(FreeformSurface((5, 5)), FreeformSurface((5, 5)), 1.0, index)


@pytest.mark.parametrize("thickness", [0.0, -1.0, np.nan, np.inf, "a"])
def test_thickness_is_refused(thickness):
    with pytest.raises(ValueError, match="thickness must be a positive finite number, got"):
        Lens(FreeformSurface((5, 5)), FreeformSurface((5, 5)), thickness, 1.5)


def test_with_rear():
    lens = plano(FreeformSurface((5, 5)), 2.0)
    other = lens.with_rear(FreeformSurface((5, 5), Conic(30, -1)))
    assert (other.front, other.thickness, other.index) == (lens.front, 2.0, 1.5)
    assert other.volume() > lens.volume()


def test_graphs_are_of_one_degree():
    """What `Lens.graphs` promises, for surfaces whose sags differ in degree."""
    lens = Lens(
        FreeformSurface((5, 5), Conic(), flat_sag(degree=2)),
        FreeformSurface((5, 5), Conic(), flat_sag(degree=4)),
        1.0,
        1.5,
    )
    degrees = {kv.degree for graph in lens.graphs() for kv in (graph.kv_u, graph.kv_v)}
    assert len(degrees) == 1
    assert lens.graphs() is lens.graphs()
