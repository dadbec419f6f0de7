"""Cusps against tools that are pressed onto spheres and planes, pass beside pass; draft against angles."""

from itertools import pairwise

import numpy as np
import pytest

from tests.thbcad.tools.cases import paraboloid, plane, rough
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.tools import ball_cusps, draft, nose_cusps

ORIGIN = np.zeros(1), np.zeros(1)


def envelope(graph, ball, centre, step, rows, reach):
    """Heights of three neighbouring rows of balls above the graph on a line across them through a position.

    Every ball touches the graph at its contact; the surface that is left is the lowest of all balls.
    """
    along = np.linspace(-reach, reach, 401)
    across = np.linspace(-step / 2, step / 2, 41)
    e, n = (
        (np.array([1.0, 0.0]), np.array([0.0, 1.0]))
        if rows == "x"
        else (np.array([0.0, 1.0]), np.array([1.0, 0.0]))
    )
    points = centre[:, None] + n[:, None] * across
    contacts = centre[:, None] + e[:, None] * along
    g = np.stack([graph(*contacts, o) for o in ((1, 0), (0, 1))])
    w = np.sqrt(1 + (g**2).sum(axis=0))
    middle, z = contacts - ball * g / w, graph(*contacts) + ball / w
    d2 = ((points[:, :, None] - middle[:, None]) ** 2).sum(axis=0)
    return across, (z - np.sqrt(ball**2 - d2)).min(axis=1) - graph(*points)


@pytest.mark.parametrize("rows", ["x", "y"])
@pytest.mark.parametrize("graph", [rough(np.random.default_rng(3), 0.02), plane(0.6, 0.8)])
def test_cusps_of_a_ball_are_those_of_the_envelope_of_its_positions(graph, rows):
    ball, step, centre = 2.0, 0.02, np.array([1.3, -0.7])
    across, left = envelope(graph, ball, centre, step, rows, reach=0.02)
    cusps = ball_cusps(graph, *centre[:, None], ball, step, rows)
    bend = np.polyfit(across, left, 2)[0] * 2
    assert np.hypot(*cusps.slopes)[0] == pytest.approx(bend * step, rel=0.01)
    assert cusps.height[0] == pytest.approx(max(left[0], left[-1]), rel=0.03)
    assert cusps.slopes[0 if rows == "x" else 1, 0] == 0


def test_what_the_formula_leaves_out_falls_with_the_step():
    """The next term of the height is of third order, the rate is 1 or better."""
    graph, centre = rough(np.random.default_rng(3), 0.05), np.array([1.3, -0.7])
    off = []
    for step in (0.16, 0.08, 0.04, 0.02):
        _, left = envelope(graph, 2.0, centre, step, "x", reach=0.1)
        cusps = ball_cusps(graph, *centre[:, None], 2.0, step, "x")
        bend = 4 * (left[0] + left[-1]) / step**2  # the mean of both sides of the pass
        off.append(abs(bend * step / np.hypot(*cusps.slopes)[0] - 1))
    assert off[0] < 0.05
    assert all(fine < 0.6 * coarse for coarse, fine in pairwise(off))


def test_the_effective_radius_is_that_against_the_curvature():
    """On a bowl of radius 12 a ball of radius 6 leaves the cusps that one of 12 leaves on a plane."""
    bowl, flat = (
        ball_cusps(paraboloid(12.0), *ORIGIN, 6.0, 0.1, "x"),
        ball_cusps(plane(0, 0), *ORIGIN, 12.0, 0.1, "x"),
    )
    assert bowl.height == pytest.approx(flat.height)
    assert bowl.slopes == pytest.approx(flat.slopes)
    assert flat.height[0] == pytest.approx(0.01 / (8 * 12))
    assert ball_cusps(plane(0, 0), *ORIGIN, 6.0, 0.1, "x").height[0] == pytest.approx(2.08e-4, rel=1e-2)


def test_a_ball_that_does_not_fit_leaves_no_known_cusps():
    for cusps in (
        ball_cusps(paraboloid(12.0), *ORIGIN, 13.0, 0.1, "x"),
        nose_cusps(paraboloid(12.0), *ORIGIN, 13.0, 0.1),
    ):
        assert np.isnan(cusps.slopes).any()
        assert np.isnan(cusps.height).all()


def test_turned_cusps_are_those_of_circles_a_feed_apart():
    """Three noses are pressed onto a sloping section, their lowest points a feed apart."""
    graph, nose, feed, x = paraboloid(9.0), 1.0, 0.02, 3.0
    slope = x / 9.0
    w = np.hypot(1, slope)
    contacts = x + feed * np.arange(-1, 2) / (1 - nose / 9.0 / w**3)  # the tool moves less than its contact
    s = contacts / 9.0
    middle, z = contacts - nose * s / np.sqrt(1 + s * s), contacts**2 / 18 + nose / np.sqrt(1 + s * s)
    assert np.diff(middle) == pytest.approx(feed, rel=1e-3)
    d = np.linspace(contacts[0], contacts[2], 4001)
    left = (z[:, None] - np.sqrt(nose**2 - (d - middle[:, None]) ** 2)).min(axis=0) - d**2 / 18
    cusps = nose_cusps(graph, np.array([x]), np.zeros(1), nose, feed)
    assert cusps.height[0] == pytest.approx(left[1000:3000].max(), rel=0.02)
    tilt = np.gradient(left, d)[1005:2995]  # from cusp to cusp
    assert cusps.slopes[0, 0] == pytest.approx(np.ptp(tilt), rel=0.02)
    assert cusps.pitch[0] == pytest.approx(np.diff(contacts)[0], rel=1e-9)


def test_cusps_refuse_what_is_no_tool():
    with pytest.raises(ValueError, match='rows must run along "x" or "y"'):
        ball_cusps(plane(0, 0), *ORIGIN, 6.0, 0.1, "z")
    with pytest.raises(ValueError, match="step must be a positive finite number"):
        ball_cusps(plane(0, 0), *ORIGIN, 6.0, 0.0, "x")
    with pytest.raises(ValueError, match="feed must be a positive finite number"):
        nose_cusps(plane(0, 0), *ORIGIN, 6.0, np.nan)


def test_draft_is_what_the_steepest_slope_leaves():
    """The slope of a paraboloid at the corner is hypot(5, 5) / R; walls between equal rims have none."""
    lens = Lens(FreeformSurface((5.0, 5.0)), FreeformSurface((5.0, 5.0), Conic(20.0, -1.0)), 4.0, 1.5)
    found = draft(lens)
    wanted = 90 - np.degrees(np.arctan(np.hypot(5, 5) / 20))
    assert found.front.lower == pytest.approx(90.0)
    assert found.rear.lower <= wanted <= found.rear.upper + 1e-12
    assert found.rear.upper - found.rear.lower < 1e-3
    assert [w.angle for w in found.walls] == [0.0] * 4


def test_leaning_walls_have_the_draft_of_their_lean():
    """Plane faces of half-width 5 and 4 mm, 2 mm apart: each wall leans by atan(1 / 2)."""
    found = draft(Lens(FreeformSurface((5.0, 5.0)), FreeformSurface((4.0, 4.0)), 2.0, 1.5))
    assert [w.angle for w in found.walls] == pytest.approx([np.degrees(np.arctan(0.5))] * 4)
