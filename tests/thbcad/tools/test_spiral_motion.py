"""The motion of a turning tool against closed forms, and against tools that are pressed onto sections."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import minimize_scalar

from tests.thbcad.tools.cases import cylinder, paraboloid, plane, rough, saddle
from thbcad.lens import FreeformSurface
from thbcad.outlines import Outline
from thbcad.sags import Conic
from thbcad.splines import BSplineSurface, KnotVector
from thbcad.tools import (
    SpiralCut,
    acceleration_at,
    greatest_acceleration,
    greatest_slope_along_cut,
    highest_rpm,
    rim_gaps,
    round_axis,
    tool_acceleration,
)
from thbcad.tools.polar_cells import polar_cells, ranges
from thbcad.tools.spiral_bounds import acceleration, greatest_section_curvature

X, Y = (a.ravel() for a in np.meshgrid(*[np.linspace(-5, 5, 62)] * 2))  # none on the axis
POINTS = np.array([2.0, -1.0, 0.5]), np.array([1.0, 2.5, -3.0])


def pressed(graph, nose, rho, theta):
    """The height of a nose's lowest point at rho_t, from the section alone."""

    def below(d):
        return -(
            graph([(rho + d) * np.cos(theta)], [(rho + d) * np.sin(theta)])[0] + np.sqrt(nose**2 - d * d)
        )

    found = minimize_scalar(below, bounds=(-0.999 * nose, 0.999 * nose), options={"xatol": 1e-12})
    return -found.fun - nose


def test_a_tilted_plane_moves_the_tool_as_a_sine():
    """z = a x: the greatest acceleration is a rho omega^2 cos theta, at the rim a 5 mm omega^2."""
    found = greatest_acceleration(plane(0.3, 0.0), tolerance=1e-6)
    assert found.lower <= 1.5 <= found.upper * (1 + 1e-12)
    assert found.upper / found.lower < 1.0001
    assert abs(found.u) == 5.0
    assert acceleration_at(60.0, 1.5) == pytest.approx((2 * np.pi) ** 2 * 1.5e-3)
    assert highest_rpm(acceleration_at(77.0, 1.5), 1.5) == pytest.approx(77.0)


def test_a_bowl_round_the_axis_needs_no_motion_but_the_feed():
    """t_rho_rho = z_rho_rho / (1 - r curvature), greatest at the bottom where it is 1 / (R - r)."""
    still = greatest_acceleration(paraboloid(12.0), nose=2.0)
    assert still.upper < 1e-4  # mm, below which nothing is told
    assert highest_rpm(1.0, 0.0) == np.inf
    fed = greatest_acceleration(paraboloid(12.0), nose=2.0, advance=0.5)
    assert fed.upper == pytest.approx(0.25 / 10.0, rel=0.01)


def test_a_saddle_turns_twice_for_each_turn():
    """z = rho^2 cos(2 theta) / 2R: |z_theta_theta| = 2 rho^2 |cos(2 theta)| / R."""
    found = greatest_acceleration(saddle(20.0))
    assert found.lower <= 2 * 25 / 20.0 * (1 + 1e-12)
    assert found.upper >= 2 * 25 / 20.0
    assert found.upper / found.lower < 1.01


def test_the_slope_along_the_cut_of_a_tilted_plane_is_its_tilt():
    found = greatest_slope_along_cut(plane(0.3, -0.4))
    assert found.lower <= 0.5 <= found.upper * (1 + 1e-12)
    assert found.upper < 0.501


def test_a_section_of_a_cylinder_bends_most_across_it():
    found = greatest_section_curvature(cylinder(9.0))
    assert found.lower <= 1 / 9 <= found.upper * (1 + 1e-12)


@pytest.mark.parametrize("nose", [0.3, 1.0])
def test_the_tool_of_a_contact_is_the_one_pressed_onto_the_section(nose):
    graph = rough(np.random.default_rng(5), 0.03)
    at = round_axis(graph, *POINTS)
    rho, lift = at.nose(nose)
    t = graph(*POINTS) + lift
    wanted = [pressed(graph, nose, r, a) for r, a in zip(rho, at.theta)]
    assert t == pytest.approx(wanted, abs=1e-9)


def test_the_tool_over_a_sphere_moves_on_the_sphere_of_its_centres():
    """The offset of a sphere is a sphere: the nose's centre lies R - r from the sphere's centre."""
    radius, nose = 20.0, 3.0
    bowl = FreeformSurface((5.0, 5.0), Conic(radius)).graph()
    x, y = np.array([0.5, 3.0, -5.0]), np.array([1.0, -4.0, 5.0])
    rho, lift = round_axis(bowl, x, y).nose(nose)
    z = bowl(x, y) + lift + nose
    assert np.hypot(rho, z - radius) == pytest.approx(radius - nose, abs=1e-8)


def test_the_acceleration_is_that_of_the_pressed_tool_by_differences():
    graph, nose, q, h = rough(np.random.default_rng(6), 0.03), 1.0, 0.2, 4e-4
    at = round_axis(graph, np.array([2.2]), np.array([1.4]))
    (rho,), _ = at.nose(nose)
    (theta,) = at.theta
    along = {
        sign: np.array([pressed(graph, nose, rho + sign * q * a, theta + a) for a in (-h, 0.0, h)])
        for sign in (-1.0, 1.0)
    }
    wanted = max(abs(t[0] - 2 * t[1] + t[2]) / h**2 for t in along.values())
    assert tool_acceleration(at, nose, q)[0] == pytest.approx(wanted, rel=1e-4)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 2.0]), st.sampled_from([0.0, 0.01]))
def test_bounds_contain_dense_samples_and_are_met(seed, nose, advance):
    graph = rough(np.random.default_rng(seed), 0.02)
    at = round_axis(graph, X, Y)
    bounds = (
        (greatest_acceleration(graph, nose, advance), tool_acceleration(at, nose, advance)),
        (greatest_section_curvature(graph), at.bend / (1 + at.slope**2) ** 1.5),
        (greatest_slope_along_cut(graph), abs(at.across)),
    )
    for found, sampled in bounds:
        assert found.lower <= found.value <= found.upper
        assert found.upper >= sampled.max()
        assert found.upper <= found.lower * 1.02 + 1e-12


def test_ranges_of_cells_contain_what_lies_in_them_also_round_the_axis():
    """Cells of level 3 below those of the graph, with 7 x 7 positions each, and the axis within one."""
    kv = KnotVector.uniform(3, 3, -5.0, 5.0)
    graph = BSplineSurface(kv, kv, 0.1 * np.random.default_rng(8).standard_normal((kv.dim, kv.dim)))
    nose, advance = 3.0, 0.05
    free = 1 - nose * greatest_section_curvature(graph).upper
    for cells in polar_cells(graph):
        for _ in range(3):
            cells = cells.quartered()
        share = np.stack([a.ravel() for a in np.meshgrid(*[np.linspace(0, 1, 7)] * 2)])[..., None]
        x, y = cells.box[0][:, None] + share * (cells.box[1] - cells.box[0])[:, None]
        at = round_axis(graph, x.ravel(), y.ravel())
        within, slack = ranges(cells), 1e-9
        turn, across, mixed, bend, slope = (
            getattr(at, name).reshape(x.shape) for name in ("turn", "across", "mixed", "bend", "slope")
        )
        assert (within.low - slack <= turn).all()
        assert (turn <= within.high + slack).all()
        assert (abs(across) <= within.across + slack).all()
        assert (within.mixed_low - slack <= abs(mixed)).all()
        assert (abs(mixed) <= within.mixed + slack).all()
        assert (within.bend_low - slack <= bend).all()
        assert (bend <= within.bend + slack).all()
        assert (within.flat - slack <= abs(slope)).all()
        assert (abs(slope) <= within.steep + slack).all()
        moved = tool_acceleration(at, nose, advance).reshape(x.shape)
        assert (moved <= acceleration(cells, 0.0, nose, advance, free).upper + slack).all()


def test_a_nose_that_does_not_fit_is_refused_with_the_radius():
    with pytest.raises(
        ValueError, match=r"nose of 12\.5 mm is not proven to fit.* 1[12][.\d]* mm; take a smaller nose"
    ):
        greatest_acceleration(paraboloid(12.0), nose=12.5)
    line = KnotVector.uniform(1, 2, -1.0, 1.0)
    with pytest.raises(ValueError, match="degree 2 or more"):
        greatest_section_curvature(BSplineSurface(line, line, np.zeros((3, 3))))


@pytest.mark.slow
def test_over_a_disk_the_bounds_are_those_of_its_points():
    """Of a rough graph and the corners of its square, where it is steeper."""
    disk, graph = Outline((5.0, 5.0), (5.0, 5.0)), rough(np.random.default_rng(1))
    inside = disk.contains(X, Y)
    at = round_axis(graph, X[inside], Y[inside])
    pairs = [
        (greatest_acceleration(graph, 0.1, 0.01, outline=disk), tool_acceleration(at, 0.1, 0.01)),
        (greatest_section_curvature(graph, outline=disk), at.bend / (1 + at.slope**2) ** 1.5),
        (greatest_slope_along_cut(graph, outline=disk), abs(at.across)),
    ]
    for found, values in pairs:
        assert found.upper >= values.max() * (1 - 1e-12)
        assert found.lower >= 0.9 * values.max()
        assert found.upper <= found.lower * 1.01
        assert disk.contains(found.u, found.v)
    tilted = greatest_slope_along_cut(plane(0.3, -0.4), outline=disk)
    assert tilted.lower <= 0.5 <= tilted.upper
    assert SpiralCut.over((5.0, 5.0), 0.01, (5.0, 5.0)).radius == pytest.approx(5.0, rel=1e-15)
    rounded = SpiralCut.over((5.0, 4.0), 0.01, (1.0, 1.0))
    assert rounded.radius == pytest.approx(np.hypot(4.0, 3.0) + 1.0, rel=1e-6)


def test_a_spiral_takes_its_radius_over_the_feed_turns():
    cut = SpiralCut.over((3.0, 4.0), 0.01)
    assert (cut.radius, cut.turns) == (5.0, 500.0)
    assert cut.hours(100.0) == pytest.approx(500 / 100 / 60)
    rho = np.linspace(0, 5, 200001)
    length = np.hypot(rho * 2 * np.pi / 0.01, 1.0).sum() * (rho[1] - rho[0]) / 1e3
    assert cut.length == pytest.approx(length, rel=1e-4)
    with pytest.raises(ValueError, match="feed must be a positive finite number"):
        SpiralCut(0.0, 5.0)


def test_across_the_gaps_a_bowl_is_continued_as_it_is():
    """On circles a bowl has one height: the polynomial across every gap is that constant."""
    gaps = rim_gaps(paraboloid(12.0), nose=1.0)
    assert gaps.kernel.max() < 1e-9
    assert np.ptp(gaps.t, axis=1).max() < 1e-12


@pytest.mark.parametrize("nose", [0.0, 0.5])
def test_the_motion_across_a_gap_begins_and_ends_with_that_on_the_lens(nose):
    graph = rough(np.random.default_rng(7), 0.03)
    gaps = rim_gaps(graph, nose)
    row = 800
    for k in (0, -1):
        x, y = gaps.x[row, k], gaps.y[row, k]
        at, z = contact_on_the_rim(graph, nose, np.hypot(x, y), np.arctan2(y, x))
        # linear between 1024 contacts
        assert gaps.t[row, k] == pytest.approx(z + at.nose(nose)[1][0], abs=1e-4)
        assert gaps.kernel[row, k] == pytest.approx(tool_acceleration(at, nose, 0.0)[0], rel=1e-3)


def contact_on_the_rim(graph, nose, rho, theta):
    """The contact of a nose on a side: (derivatives, z) there, by bisection of rho_t."""
    low, high = 0.9 * rho, 1.1 * rho
    for _ in range(60):
        middle = (low + high) / 2
        x, y = (np.clip(middle * f(theta), -5, 5) for f in (np.cos, np.sin))
        at = round_axis(graph, np.array([x]), np.array([y]))
        low, high = (middle, high) if at.nose(nose)[0][0] < rho else (low, middle)
    return at, graph([x], [y])[0]
