"""The classes of roads: their values and limits, errors, and what they refuse."""

from math import pi

import numpy as np
import pytest

from optics.base.runtime import UserError, grade
from optics.light.roads import CLASSES, Installation, road_checks
from optics.light.roads.lit_road import LitRoad
from optics.light.roads.reflection import RoadSurface
from optics.scene.luminaires import Luminaire
from thbcad.checks import Floats

STREET = Installation(8.0, 24.0)
ROAD = RoadSurface(np.full((29, 20), 300.0))


def lamp(flux: float) -> Luminaire:
    return Luminaire([0, 360], [0, 90], np.full((2, 2), flux / (2 * pi)))


def values(checks) -> Floats:
    return np.array([check.value for check in checks])


def test_a_class_p_judges_mean_and_least_illuminance():
    light = LitRoad(STREET, lamp(2000.0)).illuminance(STREET.strip(0, 7))
    checks = road_checks("P4", STREET, lamp(2000.0))
    np.testing.assert_allclose(values(checks), [light.mean(), light.mean(), light.min()])
    assert [(c.limit, c.at_least) for c in checks] == [(5.0, True), (7.5, False), (1.0, True)]
    assert {c.subject for c in checks} == {"light"}
    brighter = 2000 * 6 / light.mean()  # a mean of 6 lx
    assert grade(road_checks("P4", STREET, lamp(brighter))) == "made"
    assert grade(road_checks("P3", STREET, lamp(brighter))) == "light misses"
    assert [c.ok for c in road_checks("P5", STREET, lamp(brighter))] == [True, False, True]


def test_a_class_m_judges_the_worst_driver():
    lit = LitRoad(STREET, lamp(2000.0))
    mean, overall, along, glare, edge = values(road_checks("M4", STREET, lamp(2000.0), surface=ROAD))
    each = [lit.luminance(STREET.lane_points, y, ROAD).reshape(6, 10) for y in STREET.lane_middles]
    assert mean == pytest.approx(min(light.mean() for light in each))
    assert overall == pytest.approx(min(light.min() / light.mean() for light in each))
    assert along == pytest.approx(min(r.min() / r.max() for r in (each[0][1], each[1][4])))
    drivers = zip(STREET.lane_middles, each)
    assert glare == pytest.approx(max(lit.threshold_increment(y, light.mean()) for y, light in drivers))
    assert edge == pytest.approx(lit.edge_ratio())


def test_uniformities_keep_and_glare_grows_by_the_fifth_root_with_the_light():
    once, twice = (values(road_checks("M1", STREET, lamp(f), surface=ROAD)) for f in (1000.0, 2000.0))
    np.testing.assert_allclose(twice / once, [2, 1, 1, 2**0.2, 1], rtol=1e-12)


@pytest.mark.parametrize("kind", ["M", "P"])
def test_classes_ask_for_less_from_one_to_the_next(kind):
    asked = np.array([[limit for _, limit, _, _ in CLASSES[f"{kind}{n}"].limits] for n in range(1, 7)])
    steps = np.diff(asked, axis=0)
    assert (steps[:, 0] < 0).all()
    steps[:, 3:4] *= -1  # of glare more is allowed
    assert (steps <= 0).all()


def test_errors_are_those_of_the_spread_and_near_values_are_not_decided():
    parts = [lamp(flux) for flux in (1900.0, 2000.0, 2100.0)]
    mean = values(road_checks("P4", STREET, lamp(2000.0)))[0]
    checks = road_checks("P4", STREET, lamp(2000.0), parts)
    assert checks[0].error == pytest.approx(mean * 0.05 / np.sqrt(3))
    near = 5 / mean  # of the limit, within one standard error
    checks = road_checks("P4", STREET, lamp(near * 2010), [lamp(near * part.flux) for part in parts])
    assert checks[0].result == "undecided"
    assert grade(checks) == "not decided"


def test_a_road_surface_goes_with_classes_m():
    with pytest.raises(UserError, match="give its r-table by --r-table FILE"):
        road_checks("M4", STREET, lamp(1000.0))
    with pytest.raises(UserError, match=r"classes P are judged by illuminance, .* leave out --r-table"):
        road_checks("P4", STREET, lamp(1000.0), surface=ROAD)


def test_a_dark_lane_is_refused():
    beside = Installation(8.0, 24.0, tilt=-90.0)
    beam = Luminaire([0, 360], [0, 10], np.ones((2, 2)))
    with pytest.raises(UserError, match="no light reaches the middle of a lane; check --height"):
        road_checks("M4", beside, beam, surface=ROAD)
