"""Certified bounds over outlines, of regions that hold straight paths, and of distances between splines."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.cases import examples
from tests.thbcad.cases import seeds, spaces
from thbcad.certified import (
    Stack,
    distance_bounds,
    ellipse_supports,
    rectangle_supports,
    region_between,
    supports_of,
)
from thbcad.certified.extreme_values import minimum, minimum_on_rim, value_range
from thbcad.certified.slope_and_curvature import greatest_slope, least_radii
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.outlines import Outline
from thbcad.sags import Conic, square_coefficients
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.surfaces import THBSurface

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


ROUNDING = 1e-9


@given(st.integers(0, 1 << 30))
def test_straight_paths_stay_inside_and_clipping_keeps_them(seed):
    rng = np.random.default_rng(seed)
    groups = [rng.normal(size=(6, 12, 3)) + np.array([0, 0, z]) for z in (-8.0, 8.0)]
    for group in groups:
        group[..., 2] = group[:, :1, 2]
    stacks = [Stack(g[:, 0, 2], np.array([supports_of(points[:, :2]) for points in g])) for g in groups]
    region = region_between(*stacks).shrunk(-ROUNDING)
    start, stop = (g.reshape(-1, 3) for g in groups)
    for share in np.linspace(0, 1, 5):
        assert region.holds(start + share * (stop - start)).all()
    cut = stacks[0].towards(stacks[1], 1.0)
    share = (1.0 - start[:, 2]) / (stop - start)[:, 2]
    at = start + share[:, None] * (stop - start)
    assert (supports_of(at[:, :2]) <= cut.supports[0] + ROUNDING).all()


def test_a_box_and_a_cone_are_held_exactly():
    square, circle = rectangle_supports((2.0, 1.0)), ellipse_supports((3.0, 3.0))
    box = region_between(Stack(np.array([0.0]), square[None]), Stack(np.array([4.0]), square[None]))
    inside = box.holds(
        np.array([[1.99, 0.99, 3.99], [2.01, 0, 1], [0, 1.01, 1], [0, 0, 4.01], [0, 0, -0.01]])
    )
    assert inside.tolist() == [True, False, False, False, False]
    cone = region_between(Stack(np.zeros(1), 0 * circle[None]), Stack(np.array([3.0]), circle[None]))
    angles = np.linspace(0, 6, 50)
    for z in (0.5, 2.0):
        ring = np.column_stack([np.cos(angles), np.sin(angles), np.full_like(angles, 1.0)]) * [z, z, z]
        assert cone.holds(0.999 * ring).all()
        assert not cone.holds(ring * [1.002, 1.002, 1]).any()  # 64 sides: 1 / cos(pi / 64) = 1.0012


def test_lines_and_planes_are_cut_to_what_is_inside():
    square = rectangle_supports((2.0, 1.0))
    box = region_between(Stack(np.array([0.0]), square[None]), Stack(np.array([4.0]), square[None]))
    part = box.part_of_line(np.array([-5.0, 0.5, 1.0]), np.array([5.0, 0.5, 1.0]))
    assert np.allclose(part, [[-2, 0.5, 1], [2, 0.5, 1]])
    beside = box.part_of_line(np.array([-5.0, 1.0, 1.0]), np.array([5.0, 1.0, 1.0]))
    assert not len(beside)  # it runs in a side
    corners = box.section(np.array([0.0, 0.0, 1.0]), np.eye(3)[0], np.eye(3)[1], 50.0)
    assert np.allclose(np.abs(corners), [2, 1, 1])
    assert not len(box.section(np.array([0.0, 0.0, 4.0]), np.eye(3)[0], np.eye(3)[1], 50.0))


SHARES = np.linspace(0, 1, 101)


def spline(rng, p, q, shape=(), start=0.0, stop=1.0):
    kv_u, kv_v = KnotVector.uniform(p, 5, start, stop), KnotVector.uniform(q, 3, start, stop)
    return BSplineSurface(kv_u, kv_v, rng.uniform(-1, 1, (kv_u.dim, kv_v.dim, *shape)))


@given(spaces(max_degree=4, max_spans=4), seeds())
@examples(20)
def test_no_point_is_farther_than_the_bound_of_its_cell(space, rng):
    surface = THBSurface(space, rng.uniform(-1, 1, (space.dim, 2)))
    (a, b), (c, d) = ((kv.start, kv.stop) for kv in (space.kv_u, space.kv_v))
    kv_u, kv_v = KnotVector.uniform(2, 3, a - 1, b + 1), KnotVector.uniform(5, 2, c, d)
    other = BSplineSurface(kv_u, kv_v, rng.uniform(-1, 1, (kv_u.dim, kv_v.dim, 2)))
    points, bounds = distance_bounds(surface, other, 0.0)
    here = np.linalg.norm(surface(*points) - other(*points), axis=1)
    assert (here <= bounds).all()
    u, v = a + (b - a) * SHARES, c + (d - c) * SHARES
    most = np.linalg.norm(surface.grid(u, v) - other.grid(u, v), axis=2).max()
    assert most <= bounds.max()
    # three quarterings leave 1/64 of what coefficients exceed values by; the grid misses little
    assert bounds.max() <= 1.25 * most


@pytest.mark.parametrize("shape", [(), (3,)])
def test_one_spline_in_two_forms_has_no_distance_but_rounding(shape):
    rng = np.random.default_rng(0)
    surface = spline(rng, 3, 2, shape)
    finer = surface.insert([0.1, 0.5, 0.5], [0.7]).elevate(4, 4)
    _, bounds = distance_bounds(surface, finer, 1e-3)
    assert 0 < bounds.max() < 1e-12  # eight steps of 80 roundings of numbers below 1


def test_a_bound_above_what_is_enough_is_improved_until_a_value_is_above_it_too():
    space = THBSpace(KnotVector.uniform(3, 1), KnotVector.uniform(3, 1))
    wave = np.zeros((4, 4))
    wave[1], wave[2] = 1, -1  # values to 0.29, coefficients to 1
    surface, flat = THBSurface(space, wave.ravel()), THBSurface(space, np.zeros(16))
    assert distance_bounds(surface, flat, 1.5)[1].tolist() == pytest.approx([1.0])
    assert distance_bounds(surface, flat, 0.3)[1].max() <= 0.3
    assert distance_bounds(surface, flat, 0.28)[1].max() >= 0.2886  # 1 / (2 sqrt 3)


def test_splines_that_cannot_be_compared_are_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="splines of one dimension"):
        distance_bounds(spline(rng, 3, 3), spline(rng, 3, 3, (2,)), 1.0)
    with pytest.raises(ValueError, match="a segment needs"):
        distance_bounds(spline(rng, 3, 3), spline(rng, 3, 3, start=0.1), 1.0)
