"""Regions of uniform light and zones: areas, edges, angles and readings against closed forms."""

import tracemalloc

import numpy as np
import pytest
from matplotlib.path import Path
from scipy.spatial.transform import Rotation

from optics.scene.problem import load_problem
from optics.scene.receivers import FarField, Screen, chart_of_goniometer, zone_places, zone_rows
from optics.scene.receivers.regions import REGIONS, uniform_region
from optics.scene.receivers.zones import goniometer_of_chart, zone_readings
from optics.scene.system import System
from tests.optics.cases import SMALL, toml_text

AREAS = {"rectangle": 4.0, "ellipse": np.pi, "crescent": 2.0}  # of [-1, 1]^2


@pytest.mark.parametrize("shape", REGIONS)
@pytest.mark.parametrize("lit", [(0.75, 0.75), (1.0, 0.4), (0.313, 0.97)])
def test_coverage_adds_up_to_the_area(shape, lit):
    covered = uniform_region(shape, (120, 80), lit)
    assert covered.shape == (80, 120)
    assert covered.min() >= 0
    assert covered.max() <= 1
    area = covered.sum() * (2 / 120) * (2 / 80)
    assert area == pytest.approx(AREAS[shape] * lit[0] * lit[1], rel=5e-3)  # slices of 1/32 pixel


@pytest.mark.parametrize("shape", REGIONS)
def test_pixels_within_are_whole_and_those_beyond_are_dark(shape):
    pixels = (64, 48)
    covered = uniform_region(shape, pixels, (0.8, 0.7))
    s, t = ((np.arange(n) + 0.5) / n * 2 - 1 for n in pixels)
    s, t = np.meshgrid(s / 0.8, -t / 0.7)
    middle, half = REGIONS[shape](np.clip(s, -1, 1))
    inside = (abs(s) < 1) & (abs(t - middle) < half)
    edge = (covered > 0) & (covered < 1)
    assert (covered[inside & ~edge] == 1).all()
    assert (covered[~inside & ~edge] == 0).all()
    assert edge.mean() < 0.12


def test_a_rectangle_on_pixel_borders_is_exact():
    covered = uniform_region("rectangle", (8, 8), (0.5, 0.75))
    assert covered[1:7, 2:6].tolist() == np.ones((6, 4)).tolist()
    assert covered.sum() == 24


@pytest.mark.parametrize("shape", REGIONS)
def test_a_region_needs_memory_for_its_pixels_alone(shape):
    """All 32 slices of all columns would take 32 times as much: 4.3 GB for 4096 x 4096 pixels."""
    tracemalloc.start()
    light = uniform_region(shape, (512, 512), (0.75, 0.75))
    assert tracemalloc.get_traced_memory()[1] < 3 * light.nbytes
    tracemalloc.stop()


@pytest.mark.parametrize("shape", REGIONS)
@pytest.mark.parametrize("lit", [(1.0, 1.0), (0.8, 0.31), (0.02, 0.9), (0.9, 0.004)])
def test_every_pixel_has_the_mean_over_its_slices(shape, lit):
    """Pixel by pixel and slice by slice, without telling whole pixels from cut ones."""
    columns, rows = 21, 16
    expected = np.zeros((rows, columns))
    for column in range(columns):
        s = ((column + (np.arange(32) + 0.5) / 32) / columns * 2 - 1) / lit[0]
        s = s[abs(s) <= 1]
        middle, half = REGIONS[shape](s)
        for row in range(rows):
            top, bottom = 1 - 2 * row / rows, 1 - 2 * (row + 1) / rows
            covered = np.minimum(top, lit[1] * (middle + half)) - np.maximum(bottom, lit[1] * (middle - half))
            expected[row, column] = np.maximum(covered, 0).sum() * rows / 2 / 32
    np.testing.assert_allclose(uniform_region(shape, (columns, rows), lit), expected, atol=1e-13)


def test_the_crescent_bends_downward():
    """Row 0 is at +y: the middle of the band lies above its ends."""
    covered = uniform_region("crescent", (60, 60), (1.0, 1.0))
    rows = np.arange(60)[:, None]
    centre = (covered * rows).sum(axis=0) / covered.sum(axis=0)
    assert centre[30] < centre[0]
    assert np.allclose(covered, covered[:, ::-1], atol=1e-12)


def test_a_top_hat_needs_no_picture(tmp_path):
    values = {k: v for k, v in SMALL.items() if k != "target.image"}
    path = tmp_path / "p.toml"
    path.write_text(
        toml_text(values | {"target.kind": "tophat", "target.shape": "ellipse", "target.lit": [0.5, 0.5]})
    )
    problem = load_problem(path)
    light = System(problem).target.light
    assert light.shape == problem.target.pixels[::-1]
    assert light.mean() == pytest.approx(np.pi / 16, rel=1e-2)


FAR = FarField()
PER_STERADIAN = (180 / np.pi) ** 2


@pytest.mark.parametrize(("h", "v"), [(-8, 4), (30, -20), (0, 10), (12, 0)])
def test_a_goniometer_tilts_about_a_fixed_horizontal_axis_and_turns_about_the_lamps_vertical_one(h, v):
    """In the frame of the lamp the photometer moves by the inverse: up by V first, then aside by H."""
    direction = Rotation.from_euler("XY", [-v, h], degrees=True).apply([0.0, 0.0, 1.0])
    turned = Rotation.from_euler("y", h, degrees=True) * Rotation.from_euler("x", -v, degrees=True)
    landing = FAR.land((0.0, 0.0, 0.0), turned.apply([0.0, 0.0, 1.0]))
    assert chart_of_goniometer(h, v) == pytest.approx([landing.u, landing.v], abs=1e-12)
    assert goniometer_of_chart(landing.u, landing.v) == pytest.approx([h, v], abs=1e-12)
    other_order = FAR.land((0.0, 0.0, 0.0), direction)
    assert (abs(other_order.u - landing.u) > 1e-3) == (h != 0 and v != 0)  # the order matters


def test_at_8_degrees_left_and_4_up_the_charts_differ_by_39_thousandths():
    assert chart_of_goniometer(-8, 4) == pytest.approx([-8, 4.0392], abs=1e-4)  # atan(tan 4 / cos 8)


@pytest.mark.parametrize(
    ("intensity", "centre"),
    [(lambda cosine: 0 * cosine + 1 / (4 * np.pi), 1 / (4 * np.pi)), (lambda c: c / np.pi, 1 / np.pi)],
    ids=["isotropic", "lambertian"],
)
def test_points_read_the_intensity_of_known_sources(intensity, centre):
    """Linear between centres 0.05 degrees apart: the curvature of a cosine costs h^2 / 8 twice, 2e-7."""
    screen = Screen((10.0, 5.0), (400, 200), receiver=FAR)
    a, b = (np.tan(np.radians(axis)) for axis in screen.centres)
    cosine = 1 / np.sqrt(1 + a**2 + b[:, None] ** 2)
    power = 1200.0
    light = power * intensity(cosine) / PER_STERADIAN
    for h, v in ((0, 0), (-8, 4), (3.3, -2.7)):
        (row,) = zone_rows("", zone_places("points", [[h, v]], screen), screen, (1.0, 2.0, 0.0), 0.0)
        reading = row.reading(light[None])
        wanted = power * intensity(np.cos(np.radians(h)) * np.cos(np.radians(v)))
        assert PER_STERADIAN * reading.value == pytest.approx(wanted, rel=1e-6)
        if h == v == 0:
            assert PER_STERADIAN * reading.value == pytest.approx(power * centre, rel=1e-6)


def test_a_reading_is_exact_on_linear_light_and_its_error_is_that_of_its_pixels():
    screen = Screen((6.0, 4.0), (24, 16))
    u, v = np.meshgrid(*screen.centres)
    at = np.random.default_rng(0).uniform([-5.7, -3.7], [5.7, 3.7], (50, 2))
    assert zone_readings(at, screen) @ (2 + u - 3 * v).ravel() == pytest.approx(2 + at[:, 0] - 3 * at[:, 1])
    (row,) = zone_rows("", np.array([[0.0, 0.0]]), screen, (1.0, 3.0, 0.0), 0.0)
    draws = 2 + u + 0.1 * np.random.default_rng(1).normal(size=(8, *screen.shape))
    means = draws[:, 7:9, 11:13].mean(axis=(1, 2))  # of the four in the middle
    found = row.reading(draws)
    assert (found.value, found.error) == pytest.approx((means.mean(), means.std(ddof=1) / np.sqrt(8)))
    drifting = row.reading(draws, drift=np.full(screen.shape, 0.2))
    assert drifting.error == pytest.approx(np.hypot(found.error, 0.2))  # which adds up


@pytest.mark.parametrize("aperture", [0.0, 0.3, 0.74, 1.3, 9.0])
def test_a_reading_is_the_mean_over_an_aperture(aperture):
    """Of pixels 0.4 x 0.2 wide, cut into parts of 0.01; at a border those that touch it."""
    screen, times = Screen((3.0, 2.0), (15, 20)), (20, 40)
    light = np.random.default_rng(1).uniform(size=screen.shape)
    fine = np.repeat(np.repeat(light, times[0], 0), times[1], 1)
    at = np.round(np.random.default_rng(2).uniform([-3, -2], [3, 2], (40, 2)), 2)
    found = zone_readings(at, screen, aperture) @ light.ravel()
    parts = [round(50 * min(max(aperture, p), 2 * h)) for p, h in zip(screen.pitch, screen.half_width)]
    for (u, v), value in zip(at, found):
        middle = round(100 * (u + 3)), round(100 * (2 - v))
        column, row = (np.clip(m, half, n - half) for m, half, n in zip(middle, parts, fine.shape[::-1]))
        box = fine[row - parts[1] : row + parts[1], column - parts[0] : column + parts[0]]
        assert value == pytest.approx(box.mean(), rel=1e-10)


@pytest.mark.parametrize("right", [1, -1])
def test_a_polygon_is_read_where_matplotlib_says_that_pixels_lie_within(right):
    screen = Screen((10.0, 6.0), (40, 24), receiver=FAR)
    corners = np.array([(-8, 1), (-8, 4), (8, 4), (8, 2), (6, 1.5), (1.5, 1.5), (0, 0), (-4, 0)])
    u, v = (axis.ravel() for axis in np.meshgrid(*screen.centres))
    h, up = goniometer_of_chart(u, v)
    within = Path(corners).contains_points(np.stack([right * h, up], axis=1))
    at = zone_places("polygon", corners, screen, right)
    border = len(at) - np.count_nonzero(within)
    assert at[border:] == pytest.approx(np.stack([u, v], axis=1)[within], abs=1e-12)
    assert np.linalg.norm(np.diff(at[:border], axis=0), axis=1).max() < 0.5 * min(screen.pitch) * 1.05


def test_a_region_has_its_least_light_above_one_limit_and_its_greatest_below_the_other():
    screen = Screen((10.0, 10.0), (40, 40))
    light = np.full(screen.shape, 5.0)
    light[20, 10], light[30, 30] = 4.0, 7.0  # the second at (5.25, -5.25)
    at = zone_places("box", [[-9, -9], [9, 9]], screen)
    darkest, brightest = zone_rows("all", at, screen, (4.5, 6.5, 0.0), 0.1)
    assert (darkest.name, brightest.name) == ("all, darkest", "all, brightest")
    found = [row.reading(light[None]) for row in (darkest, brightest)]
    assert [f.value for f in found] == pytest.approx([4.0, 7.0])
    assert [f.margin for f in found] == pytest.approx([4 / 4.5 - 1, 1 - 7 / 6.5])
    (peak,) = zone_rows("peak", at, screen, (4.0, 8.0, 0.0), 0.1, peak=True)
    assert peak.reading(light[None])[:1] == pytest.approx((7.0,))
    (share,) = zone_rows("share", np.array([[0.0, 0.0]]), screen, (0.0, np.inf, 0.8), 0.1)
    assert share.reading(light[None]).limit == pytest.approx(0.8 * 7)
    draws = light + 0.01 * np.random.default_rng(1).normal(size=(8, *screen.shape))
    off = draws[:, 19:21, 19:21].mean(axis=(1, 2)) - 0.8 * draws[:, 30, 30]  # the limit errs with its pixel
    assert share.reading(draws).error == pytest.approx(off.std(ddof=1) / np.sqrt(8))


@pytest.mark.parametrize("margin", [0.3, 1.0, 2.0])
def test_a_limit_from_below_alone_is_aimed_at_with_its_whole_margin(margin):
    screen = Screen((6.0, 4.0), (24, 16))
    (row,) = zone_rows("", np.array([[0.0, 0.0]]), screen, (1.0, np.inf, 0.0), margin)
    assert row.aims(np.ones(screen.shape)) == (1.0 + margin, np.inf)
