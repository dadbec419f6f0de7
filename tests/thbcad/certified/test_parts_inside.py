"""Certified bounds over outlines against closed forms, dense samples and the bounds of the rectangle."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.cases import examples
from thbcad.certified.extreme_values import minimum, minimum_on_rim, value_range
from thbcad.certified.slope_and_curvature import greatest_slope, least_radii
from thbcad.lens import FreeformSurface
from thbcad.outlines import Outline
from thbcad.sags import Conic, square_coefficients
from thbcad.splines import BSplineSurface, KnotVector

R = 30.0
DISK = Outline((R, R), (R, R))
EPS = np.finfo(float).eps


def surface(half_width, conic, spans=5):
    kv_x, kv_y = (KnotVector.uniform(3, spans, -h, h) for h in half_width)
    net = square_coefficients(kv_x)[:, None] + square_coefficients(kv_y)
    return BSplineSurface(kv_x, kv_y, net * conic)


def test_a_paraboloid_over_a_disk_has_its_height_its_slope_and_its_radius():
    """z = r^2 / 100: 9 mm and 0.6 at the rim of 30 mm, radius 50 mm in the middle.  Bounds of heights meet
    but for rounding, as the height is constant on the rim together with q."""
    bowl = surface(DISK.half_width, 1 / 100)
    least, greatest = value_range(bowl, outline=DISK)
    for found, value in ((least, 0.0), (greatest, 9.0), (minimum_on_rim(bowl, DISK), 9.0)):
        assert found.lower <= value <= found.upper
        assert found.upper - found.lower < 1e5 * EPS
    steepest = greatest_slope(bowl, 1e-5, DISK)
    assert steepest.lower <= 0.6 * (1 + EPS)
    assert 0.6 <= steepest.upper < 0.6 * (1 + 1.01e-5)
    assert least_radii(bowl, outline=DISK).concave.lower == pytest.approx(50, rel=1e-9)


def test_a_sphere_over_a_disk_has_its_height_to_the_tolerance_of_rims():
    cap = FreeformSurface(DISK.half_width, Conic(150.0)).graph()
    height = 150 - np.sqrt(150**2 - R**2)
    greatest = value_range(cap, tolerance=1e-12, outline=DISK)[1]
    assert greatest.lower - 1e-11 <= height <= greatest.upper + 1e-11  # of the spline
    assert greatest.upper - greatest.lower < 1.1e-7 * np.abs(cap.coefficients).max()
    around = minimum_on_rim(cap, DISK)
    assert around.lower - 1e-11 <= height <= around.upper + 1e-11


def test_a_plane_has_its_extremes_on_the_rim_of_rounded_corners():
    """a x + b y over an outline is greatest where the normal of its corner is (a, b)."""
    outline, slope = Outline((12.0, 9.0), (3.0, 4.0)), np.array([0.3, 0.4])
    kv_x, kv_y = (KnotVector.uniform(3, 3, -h, h) for h in outline.half_width)
    plane = BSplineSurface(kv_x, kv_y, slope[0] * kv_x.greville()[:, None] + slope[1] * kv_y.greville())
    straight = np.subtract(outline.half_width, outline.corners)
    value = slope @ straight + np.hypot(*(slope * outline.corners))
    least, greatest = value_range(plane, outline=outline)
    assert greatest.lower <= value <= greatest.upper < value + 1e-6
    assert least.lower <= -value <= least.upper


@pytest.mark.parametrize("share", [0.05, 0.5, 1.0])
def test_the_corners_of_the_rectangle_do_not_count(share):
    """z = (x y)^2 is greatest in the corners; the rectangle's bound is never below the outline's."""
    hx, hy = 4.0, 3.0
    outline = Outline((hx, hy), (share * hx, share * hy))
    kv_x, kv_y = (KnotVector.uniform(2, 4, -h, h) for h in outline.half_width)
    peak = BSplineSurface(kv_x, kv_y, np.outer(square_coefficients(kv_x), square_coefficients(kv_y)))
    turn = np.pi / 4  # the corner of the outline: both of its lengths s are cos(pi/4)
    x, y = (h * (1 - share + share * np.cos(turn)) for h in (hx, hy))
    found = value_range(peak, outline=outline)[1]
    assert found.lower <= (x * y) ** 2 <= found.upper * (1 + 4 * EPS)
    assert found.upper < value_range(peak)[1].lower


@st.composite
def cases(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    half = rng.uniform(1, 40, 2)
    corners = half * draw(st.sampled_from([(1.0, 1.0), (0.5, 0.2), (0.02, 0.02)]))
    degrees, spans = rng.integers(1, 5, 2), rng.integers(1, 6, 2)
    kv = [KnotVector.uniform(int(p), int(n), -h, h) for p, n, h in zip(degrees, spans, half)]
    return BSplineSurface(*kv, rng.standard_normal([k.dim for k in kv])), Outline(half, corners), rng


@examples(8)
@given(cases())
def test_no_point_inside_lies_beyond_the_bounds_and_some_point_meets_them(case):
    """Samples, at random and on the rim, err by few roundings of the coefficients, their slopes by at most
    p n / h times these."""
    graph, outline, rng = case
    h, c = np.array(outline.half_width), np.array(outline.corners)
    angle = rng.uniform(0, np.pi / 2, 1000)
    rim = np.stack([h[0] - c[0] * (1 - np.cos(angle)), h[1] - c[1] * (1 - np.sin(angle))])
    points = np.concatenate(
        [rng.uniform(-1, 1, (2, 4000)) * h[:, None], rim * rng.choice([-1, 1], (2, 1000))], 1
    )
    points = np.clip(points, -h[:, None], h[:, None])
    points = points[:, outline.contains(*points, 1e-12)]
    for derivative in ((0, 0), (1, 0)):
        smooth = graph.kv_u.degree > derivative[0] or derivative == (0, 0)
        size = np.abs(graph.coefficients).max() * (40 / h[0]) ** derivative[0]
        z = graph(*points, derivative)
        least, greatest = value_range(graph, derivative, outline=outline)
        assert least.lower <= z.min() + 1e-11 * size
        assert greatest.upper >= z.max() - 1e-11 * size
        if smooth:
            assert outline.contains(greatest.u, greatest.v, 1e-11)
            assert float(graph(greatest.u, greatest.v, derivative)) == pytest.approx(
                greatest.value, abs=1e-10 * size
            )
        whole = value_range(graph, derivative)
        assert greatest.lower <= whole[1].upper
        assert least.upper >= whole[0].lower
        assert greatest.upper <= whole[1].upper + 2e-7 * size
    around = minimum_on_rim(graph, outline)
    z = graph(*np.clip(rim, 0, h[:, None]))
    assert around.lower <= z.min() + 1e-11
    assert minimum(graph, outline=outline).lower <= around.upper
