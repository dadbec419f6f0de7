"""Lenses: records that can exist, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial import ConvexHull

from oracles.spline_definitions import flux_volume
from tests.cases import examples
from tests.thbcad.cases import EPS, lenses
from tests.thbcad.lens.cases import flat_sag, plano
from thbcad.hierarchy import THBSpace
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.lens import Lens
from thbcad.lens.soundness import require_sound
from thbcad.sags import CONIC_TOLERANCE, Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


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


@examples(25)
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


@pytest.mark.parametrize("index", [0.99, 0.5, -1.5, np.nan, np.inf, None])
def test_index_is_refused(index):
    with pytest.raises(ValueError, match="index must be a finite number of at least 1, got"):
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
