"""Zones: goniometer angles against rotations, readings against closed forms, regions against matplotlib's."""

import numpy as np
import pytest
from matplotlib.path import Path
from scipy.spatial.transform import Rotation

from optics.scene.receivers import FarField, Screen, chart_of_goniometer, zone_places, zone_rows
from optics.scene.receivers.zones import goniometer_of_chart, zone_readings

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
        reading = row.reading(light, np.zeros(screen.shape))
        wanted = power * intensity(np.cos(np.radians(h)) * np.cos(np.radians(v)))
        assert PER_STERADIAN * reading.value == pytest.approx(wanted, rel=1e-6)
        if h == v == 0:
            assert PER_STERADIAN * reading.value == pytest.approx(power * centre, rel=1e-6)


def test_a_reading_is_exact_on_linear_light_and_its_error_is_that_of_independent_pixels():
    screen = Screen((6.0, 4.0), (24, 16))
    u, v = np.meshgrid(*screen.centres)
    at = np.random.default_rng(0).uniform([-5.7, -3.7], [5.7, 3.7], (50, 2))
    assert zone_readings(at, screen) @ (2 + u - 3 * v).ravel() == pytest.approx(2 + at[:, 0] - 3 * at[:, 1])
    (row,) = zone_rows("", np.array([[0.0, 0.0]]), screen, (1.0, 3.0, 0.0), 0.0)
    found = row.reading(2 + u, np.full(screen.shape, 0.1))
    assert found.error == pytest.approx(0.1 / 2)  # the mean of four


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
    found = [row.reading(light, 0 * light) for row in (darkest, brightest)]
    assert [f.value for f in found] == pytest.approx([4.0, 7.0])
    assert [f.margin for f in found] == pytest.approx([4 / 4.5 - 1, 1 - 7 / 6.5])
    (peak,) = zone_rows("peak", at, screen, (4.0, 8.0, 0.0), 0.1, peak=True)
    assert peak.reading(light, 0 * light)[:1] == pytest.approx((7.0,))
    (share,) = zone_rows("share", np.array([[0.0, 0.0]]), screen, (0.0, np.inf, 0.8), 0.1)
    assert share.reading(light, 0 * light).limit == pytest.approx(0.8 * 7)
