"""Balls and noses against closed forms, and against tools that are pressed onto dense samples."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.thbcad.tools.cases import cylinder, paraboloid, rough
from thbcad.lens import FreeformSurface, Lens
from thbcad.outlines import Outline
from thbcad.sags import Conic, square_coefficients
from thbcad.splines import BSplineSurface, KnotVector, interpolate
from thbcad.tools import air_side, ball_fit, concavity, draft, nose_fit


def test_a_ball_fits_a_bowl_up_to_the_radius_of_its_bottom():
    graph = paraboloid(12.0)
    assert ball_fit(graph, 11.99).proven
    assert ball_fit(graph, 12.01).refuted
    least = ball_fit(graph, 1.0).least
    assert np.hypot(least.u, least.v) < 0.1


def test_between_the_bounds_nothing_is_said():
    least = ball_fit(paraboloid(12.0), 1.0).least
    between = ball_fit(paraboloid(12.0), (least.lower + least.upper) / 2)
    assert least.lower < least.upper
    assert not between.proven
    assert not between.refuted


def test_every_tool_fits_a_dome():
    for fit in (ball_fit(paraboloid(-12.0), 1e6), nose_fit(paraboloid(-12.0), 1e6)):
        assert fit.proven
        assert fit.least.lower == fit.least.upper == np.inf


def test_the_air_of_a_front_lies_below_it():
    """A front that bulges to -z is convex for its tool, and its rear twin concave."""
    bowl = FreeformSurface((5.0, 5.0), Conic(20.0, -1.0))
    lens = Lens(bowl, bowl, 4.0, 1.5)
    assert ball_fit(air_side(lens, "front"), 1e6).proven
    assert ball_fit(air_side(lens, "rear"), 20.01).refuted
    with pytest.raises(ValueError, match="front and rear, got 'side'"):
        air_side(lens, "side")


def test_a_nose_fits_a_cylinder_by_its_section_through_the_axis():
    """The section of z = x^2 / 2R at the angle theta has the curvature cos^2 theta / R at the axis."""
    fit = nose_fit(cylinder(9.0), 1.0)
    assert fit.least.lower <= 9.0 <= fit.least.upper * (1 + 1e-12)
    assert fit.least.upper / fit.least.lower < 1.001


@pytest.mark.slow
def test_a_toroid_is_fitted_by_its_lesser_radius():
    """A circle of radius b turned round an axis a above its vertex: radii a along x and b along y there."""
    a, b = 30.0, 12.0
    kv = KnotVector.uniform(5, 12, -5.0, 5.0)
    toroid = interpolate(kv, kv, lambda x, y: a - np.sqrt((a - b + np.sqrt(b * b - y * y)) ** 2 - x * x))
    for fit in (ball_fit, nose_fit):
        least = fit(toroid, 1.0).least
        assert least.value == pytest.approx(b, rel=1e-3)
    assert ball_fit(toroid, 11.9).proven


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, np.inf])
def test_radii_are_positive(radius):
    for fit in (ball_fit, nose_fit):
        with pytest.raises(ValueError, match=r"the radius of a (ball|nose) must be a positive finite number"):
            fit(paraboloid(12.0), radius)


@pytest.mark.slow
@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_bounds_contain_dense_samples(seed):
    graph = rough(np.random.default_rng(seed))
    x, y = (a.ravel() for a in np.meshgrid(*[np.linspace(-5, 5, 61)] * 2))
    for fit, spiral in ((ball_fit, False), (nose_fit, True)):
        sampled = concavity(graph, x, y, spiral).max()
        least = fit(graph, 1.0).least
        assert 1 / least.lower >= sampled * (1 - 1e-9)
        at = concavity(graph, np.array([least.u]), np.array([least.v]), spiral)[0]
        assert at == pytest.approx(1 / least.value, rel=1e-6)


@settings(deadline=None, max_examples=4)
@given(st.integers(0, 2**32 - 1))
def test_a_ball_that_fits_cuts_nowhere_into_the_graph_and_one_that_does_not_does(seed):
    """The ball is set on the graph's tangent plane and held against samples of the graph below it."""
    rng = np.random.default_rng(seed)
    graph = rough(rng)
    x, y = rng.uniform(-2, 2, (2, 30))
    small = min(0.999 * ball_fit(graph, 1.0).least.lower, 1.4)  # the disc lies over the graph
    assert all(_depth(graph, small, *p) > -1e-9 for p in zip(x, y))
    bends = concavity(graph, x, y, False)
    k = int(np.argmax(bends))
    assert _depth(graph, 1.05 / bends[k], x[k], y[k], reach=0.05) < 0


def _depth(graph, radius, x, y, reach=1.0):
    """The least height of a ball above the graph, where it touches at (x, y)."""
    g = np.array([graph([x], [y], o)[0] for o in ((1, 0), (0, 1))])
    w = np.sqrt(1 + g @ g)
    centre = np.array([x, y]) - radius * g / w
    z = graph([x], [y])[0] + radius / w
    u, v = (
        np.clip(c + reach * radius * np.linspace(-1, 1, 301), -5, 5)
        for c in ((x, y) if reach < 1 else centre)
    )
    d2 = (u[:, None] - centre[0]) ** 2 + (v[None] - centre[1]) ** 2
    under = d2 < radius**2
    gap = z - np.sqrt(np.where(under, radius**2 - d2, 0)) - graph.grid(u, v)
    return gap[under].min()


@pytest.mark.slow
def test_what_a_disk_leaves_out_bounds_neither_tools_nor_draft():
    """z = x^2 y^2 / 500 bends most in the corners of the square, also in sections through the axis."""
    kv, disk = KnotVector.uniform(3, 4, -5.0, 5.0), Outline((5.0, 5.0), (5.0, 5.0))
    graph = BSplineSurface(kv, kv, np.outer(square_coefficients(kv), square_coefficients(kv)) / 500)
    x, y = (a.ravel() for a in np.meshgrid(*[np.linspace(-5, 5, 401)] * 2))
    held = disk.contains(x, y)
    least = 1 / concavity(graph, x[held], y[held], spiral=False).max()
    found = ball_fit(graph, 1.0, disk).least
    assert found.lower <= least <= found.upper * 1.01
    assert nose_fit(graph, 1.0, disk).least.lower > 1.2 * nose_fit(graph, 1.0).least.upper
    flat = FreeformSurface((5.0, 5.0), corners=(5.0, 5.0))
    bowl = FreeformSurface((5.0, 5.0), Conic(-20.0, -1.0), None, (5.0, 5.0))
    slope = 90 - draft(Lens(flat, bowl, 3.0, 1.5)).rear.value
    assert slope == pytest.approx(np.degrees(np.arctan(0.25)), rel=1e-5)
