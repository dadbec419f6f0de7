"""Rectangles with elliptic corners against their definition, quadrature and the device's twin."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import quad

from optics.base.runtime import load_backend
from optics.light.intersections import gauge
from tests.cases import examples
from thbcad.outlines import Outline

SIZES = st.floats(0.1, 100.0)
SHARES = st.one_of(st.just(1.0), st.floats(1e-3, 1.0))


@st.composite
def outlines(draw):
    """Rectangles, ellipses and what lies between them."""
    h, r = ([draw(s) for _ in range(2)] for s in (SIZES, SHARES))
    return Outline(h, [a * b for a, b in zip(h, r)] if draw(st.booleans()) else (0.0, 0.0))


def depth(outline, x, y):
    """1 less the greatest of what the definition asks to be at most 1, of the sides and of the corners."""
    (hx, hy), (cx, cy) = outline.half_width, outline.corners
    sides = 1 - np.maximum(abs(x) / hx, abs(y) / hy)
    if not cx:
        return sides
    sx, sy = np.maximum(0, abs(x) - (hx - cx)) / cx, np.maximum(0, abs(y) - (hy - cy)) / cy
    return np.minimum(sides, 1 - np.hypot(sx, sy))


def rounding(outline):
    """What rounding leaves of numbers of about 1: corners amplify it by the inverse of their size."""
    return 1e-12 / (min(outline.relative_corners) or 1.0)


@examples(60)
@given(outlines(), st.integers(0, 2**32 - 1))
def test_points_inside_are_those_of_the_definition(outline, seed):
    x, y = np.random.default_rng(seed).uniform(-1.1, 1.1, (2, 500)) * np.array(outline.half_width)[:, None]
    certain = abs(depth(outline, x, y)) > 1e-9
    assert (outline.contains(x, y) == (depth(outline, x, y) >= 0))[certain].all()


@examples(60)
@given(outlines(), st.floats(0.01, 100.0), st.integers(0, 2**32 - 1))
def test_the_gauge_grows_as_a_point_goes_away_and_is_1_on_the_rim(outline, factor, seed):
    x, y = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, 200)) * np.array(outline.half_width)[:, None]
    k = outline.gauge(x, y)
    assert np.allclose(outline.gauge(factor * x, factor * y), factor * k, rtol=rounding(outline), atol=0)
    assert abs(depth(outline, x / k, y / k)).max() < rounding(outline)


@examples(20)
@given(outlines())
def test_the_area_is_that_of_the_points_inside(outline):
    (hx, hy), (cx, cy) = outline.half_width, outline.corners

    def height(x):
        s = max(0.0, x - (hx - cx)) / cx if cx else 0.0
        return hy - cy * (1 - np.sqrt(max(0.0, 1 - s * s)))

    area = 4 * sum(quad(height, a, b)[0] for a, b in ((0, hx - cx), (hx - cx, hx)))
    assert outline.area == pytest.approx(area, rel=1e-7)


@examples(20)
@given(outlines(), st.integers(2, 40), st.integers(2, 40))
def test_shares_of_cells_add_up_to_the_area(outline, nx, ny):
    hx, hy = outline.half_width
    x, y = np.linspace(-hx, hx, nx + 1)[:, None], np.linspace(-hy, hy, ny + 1)
    shares = outline.shares((x[:-1], y[:-1]), (x[1:], y[1:]), fine=16)
    assert shares.shape == (nx, ny)
    assert ((shares >= 0) & (shares <= 1)).all()
    # of cells that the rim crosses, at most 2 (nx + ny), each errs by less than a row of its points
    assert shares.mean() * 4 * hx * hy == pytest.approx(outline.area, rel=2 * (nx + ny) / (nx * ny) / 16)


@examples(20)
@given(outlines(), st.integers(0, 2**32 - 1))
def test_the_device_has_the_same_gauge(outline, seed):
    backend = load_backend("double", 1)
    x, y = np.random.default_rng(seed).uniform(-1.5, 1.5, (2, 300)) * np.array(outline.half_width)[:, None]
    found = gauge(backend, outline, backend.array(x), backend.array(y)).numpy()
    assert np.allclose(found, outline.gauge(x, y), rtol=rounding(outline), atol=0)


@pytest.mark.parametrize(
    ("half_width", "corners", "words"),
    [
        ((1, 1), (2, 2), "up to the half-widths"),
        ((1, 1), (0.5, 0), "both 0 or both above"),
        ((1, 1), (-1, -1), "at least 0"),
        ((1, 1), (np.nan, 1), "at least 0"),
        ((1, 1), (1,), "two numbers"),
        ((0, 1), (0, 0), "half_width"),
    ],
)
def test_impossible_corners_are_refused(half_width, corners, words):
    with pytest.raises(ValueError, match=words):
        Outline(half_width, corners)


@pytest.mark.slow
@pytest.mark.parametrize("corners", [(2.0, 2.0), (5.0, 4.0), (0.3, 1.5)])
def test_a_chord_ends_where_the_gauge_is_one(corners):
    outline, rng = Outline((5.0, 4.0), corners), np.random.default_rng(3)
    origin, direction = rng.uniform(-7, 7, (2, 2000)), rng.normal(size=(2, 2000))
    direction[:, :20], direction[0, 20:40], direction[1, 40:60] = 0.0, 0.0, 0.0
    start, stop = outline.chord(origin, direction)
    met = start < stop
    t = np.linspace(-40, 40, 4001)[:, None]  # steps of a fiftieth of the direction
    gauge = outline.gauge(*(o + t * d for o, d in zip(origin, direction)))
    assert (met | (gauge > 1).all(axis=0)).all()
    ends, o, d = (a[:, met & np.isfinite(start)] for a in (np.array([start, stop]), origin, direction))
    assert (outline.gauge(*(o + ends.mean(axis=0) * d)) <= 1 + 1e-12).all()
    assert outline.gauge(*(o[:, None] + ends * d[:, None])) == pytest.approx(np.ones_like(ends), abs=1e-12)


@examples(40)
@given(outlines(), st.sampled_from([3, 4, 7, 64]))
def test_a_circumscribed_polygon_touches_the_outline_with_every_side(outline, sides):
    """All of the rim lies to the left of all sides, and some of it on each."""
    corners = outline.circumscribed(sides) / outline.half_width
    t = np.linspace(-1, 1, 2001)
    one = np.ones_like(t)
    square = np.hstack([(t, -one), (one, t), (-t, one), (-one, -t)]) * np.array(outline.half_width)[:, None]
    rim = np.array(outline.filled(*square)) / np.array(outline.half_width)[:, None]
    angles = 2 * np.pi / sides * np.arange(sides)
    outward = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for normal, start, end in zip(outward, np.roll(corners, 1, axis=0), corners):
        reach = (normal @ rim).max()
        assert normal @ start == pytest.approx(reach, abs=2e-3)
        assert normal @ end == pytest.approx(reach, abs=2e-3)
        assert reach <= normal @ end + 1e-12
    if sides % 4 == 0:
        assert np.abs(corners).max() <= 1 + 1e-12


def test_a_polygon_around_an_ellipse_has_its_area_in_closed_form():
    x, y = Outline((3.0, 2.0), (3.0, 2.0)).circumscribed(64).T
    area = (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2
    assert area == pytest.approx(6 * 64 * np.tan(np.pi / 64), rel=1e-13)


@examples(20)
@given(outlines(), st.floats(0, 2 * np.pi))
def test_the_support_is_that_of_the_farthest_point_of_the_rim(outline, angle):
    """Of 20,000 points a step d apart on a rim, the farthest lies within d of the one that is looked for."""
    direction = np.array([np.cos(angle), np.sin(angle)])
    t = np.linspace(-1, 1, 5001)
    one = np.ones_like(t)
    square = np.hstack([(t, -one), (one, t), (-t, one), (-one, -t)]) * np.array(outline.half_width)[:, None]
    rim = np.array(outline.filled(*square))
    step = np.linalg.norm(np.diff(rim, axis=1), axis=0).max()
    assert (
        -1e-12 * max(outline.half_width)
        <= outline.support(direction[:, None])[0] - (direction @ rim).max()
        <= step
    )
