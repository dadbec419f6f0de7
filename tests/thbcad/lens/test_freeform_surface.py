"""Freeform surfaces and their graphs."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import NdBSpline

from oracles.spline_definitions import gamma
from tests.thbcad.cases import EPS, R2, X, Y, surfaces
from tests.thbcad.lens.cases import flat_sag, plano
from thbcad.hierarchy import THBSpace
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.lens import Lens
from thbcad.lens.soundness import require_sound
from thbcad.sags import CONIC_TOLERANCE, Conic, square_coefficients
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


def wavy_surface(degree=3):
    """A conic with a THB sag over [0, 1] x [-2, 3], refined in a corner, on 5 mm x 4 mm."""
    space = THBSpace(KnotVector.uniform(degree, 4), KnotVector.uniform(degree, 5, -2, 3))
    space = space.refine({0: [(i, j) for i in range(4) for j in range(4)]}).refine(
        {1: [(i, j) for i in range(4) for j in range(5)]}
    )
    return FreeformSurface((5, 4), Conic(40, -0.5), THBSurface(space, np.sin(np.arange(space.dim))))


# ---- freeform surfaces ----


@pytest.mark.parametrize(
    "half_width",
    [(5,), (5, 5, 5), (0, 5), (5, -1), (np.nan, 5), (5, np.inf), None, (5, "a"), 5, (True, True), (5, True)],
)
def test_half_width_is_refused(half_width):
    with pytest.raises(ValueError, match="half_width must be two positive numbers"):
        FreeformSurface(half_width)


def test_a_conic_that_ends_in_the_corner_but_for_rounding_is_refused():
    """Another formula puts the end of this one beyond the corner, where its height is NaN."""
    with pytest.raises(ValueError, match=r"ends at r = 30.634 mm, but the corner .* at r = 30.634 mm"):
        FreeformSurface((6.2, 30.0), Conic(30.63396807467162))


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


def test_spheres_without_a_sag_get_few_knots():
    lens = Lens(FreeformSurface((5, 5), Conic(40, 0)), FreeformSurface((5, 5), Conic(-30, 0)), 5, 1.5)
    front, rear = lens.graphs()
    assert front.kv_u.degree == rear.kv_u.degree == 5
    assert max(front.coefficients.shape + rear.coefficients.shape) < 60


def test_shapes_of_grids():
    surface = wavy_surface()
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


@pytest.mark.every(3)
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


@pytest.mark.parametrize("size", [1e2, 1e3, 1e5])
@pytest.mark.parametrize("conic", [Conic(2.0), Conic(-1.9), Conic(1.5, -0.5), Conic(4.0, 2.0)])
def test_conic_graphs_of_wide_lenses_are_within_a_share_of_their_width(conic, size):
    wide = Conic(size * conic.radius, conic.constant)
    graph = FreeformSurface((size, 0.8 * size), wide).graph()
    x, y = (np.linspace(-h, h, 101) for h in (size, 0.8 * size))
    assert abs(graph.grid(x, y) - wide(x[:, None], y[None, :])).max() <= 1e-13 * size


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


STEEP = {
    "a mild hyperboloid far beyond its radius": ((74.6, 74.6), Conic(56.2, -2.0)),
    "a sphere to 0.94 of its radius": ((20.0, 20.0), Conic(30.0)),
    "a sphere to 0.9999 of its radius": ((5.0, 5.0), Conic(np.hypot(5.0, 5.0) / 0.9999)),
    "an oblate ellipsoid": ((6.0, 3.0), Conic(-9.6, 1.0)),
}


@pytest.mark.every(3)
@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize(("half_width", "conic"), STEEP.values(), ids=STEEP)
def test_steep_conics_with_a_sag_become_splines_of_degree_five(half_width, conic, degree):
    """Cubics want more than 1000 control points per direction for them, or more than 2000."""
    space = THBSpace(KnotVector.uniform(degree, 4), KnotVector.uniform(degree, 5))
    space = space.refine({0: [(0, 0), (1, 0), (0, 1), (1, 1)]})
    surface = FreeformSurface(half_width, conic, THBSurface(space, 0.1 * np.sin(np.arange(space.dim))))
    graph = surface.graph()
    assert (graph.kv_u.degree, graph.kv_v.degree) == (5, 5)
    assert max(graph.coefficients.shape) <= 1000
    x, y = (np.concatenate([np.linspace(-h, h, 211), h * (1 - np.logspace(-9, -2, 40))]) for h in half_width)
    z = surface.grid(x, y)
    assert abs(graph.grid(x, y) - z).max() <= CONIC_TOLERANCE + 100 * EPS * abs(z).max()
    assert surface.sag.to_bspline().kv_u.degree == degree  # the sag itself stays what it is


def test_a_lens_with_a_steep_rear_is_sound_and_has_graphs_of_one_degree():
    surface = FreeformSurface((20.0, 20.0), Conic(30.0), flat_sag())
    lens = Lens(FreeformSurface((20.0, 20.0), Conic(), flat_sag()), surface, 4.0, 1.5)
    front, rear = require_sound(lens).graphs()
    assert {front.kv_u.degree, front.kv_v.degree, rear.kv_u.degree, rear.kv_v.degree} == {5}
    assert [graph.kv_u.degree for graph in lens.own_graphs()] == [3, 5]


def test_conics_that_no_spline_of_that_size_follows_are_refused():
    """The sentence names the limit and the remedy."""
    with pytest.raises(
        ValueError,
        match=r"radius 5\.000001 and K 0\.0 cannot be written as a spline to 1e-11 mm with 2000 control "
        r"points per direction of degree 5: the corner of the surface lies at r = 5 mm, at 0\.9999998 of the "
        "radius where the conic ends; make the half-width smaller, or the radius larger",
    ):
        FreeformSurface((5, 1e-4), Conic(5.000001)).graph()


def test_degree_one_is_refused():
    surface = FreeformSurface((5, 4), Conic(), flat_sag(degree=1))
    with pytest.raises(ValueError, match="a lens surface needs degree 2 or more"):
        surface.graph()
    with pytest.raises(ValueError, match="degree 2 or more"):
        require_sound(plano(surface))


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
