"""Roads under lamps of known light: point by point, by the formulas of EN 13201-3 in loops."""

from dataclasses import replace
from math import acos, atan2, cos, degrees, dist, hypot, pi, radians, sin, tan

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import UserError
from optics.light.roads import Installation, read_r_table
from optics.light.roads.lit_road import LitRoad
from optics.light.roads.reflection import BETAS, TANGENTS, RoadSurface
from optics.scene.luminaires import Luminaire
from tests.cases import examples

FLUX = 1000.0
GAMMAS = np.arange(0, 90.01, 0.1)  # between them (P / pi) cos is linear within h^2 / 8 = 4e-7 of its value
LAMBERTIAN = Luminaire([0, 360], GAMMAS, FLUX / pi * np.cos(np.radians(GAMMAS)).clip(0) * np.ones((2, 1)))
ISOTROPIC = Luminaire([0, 360], [0, 180], np.full((2, 2), FLUX / (4 * pi)))
STREET = Installation(8.0, 27.0, lanes=2, lane_width=3.5, overhang=1.0, rows="staggered", maintenance=0.7)
# 300 + tan gamma * beta is bilinear: what lies between its numbers is known
ROAD = RoadSurface(300 + TANGENTS[:, None] * BETAS)


def lamps(road, far=40):
    """Return x and y of the lamps of a staggered street."""
    right = [(k * road.spacing, road.overhang) for k in range(-far, far)]
    return right + [((k + 0.5) * road.spacing, road.width - road.overhang) for k in range(-far, far)]


@pytest.mark.parametrize(
    ("lamp", "intensity"),
    [(LAMBERTIAN, lambda c: FLUX / pi * c), (ISOTROPIC, lambda c: FLUX / (4 * pi))],
    ids=["Lambertian", "isotropic"],
)
def test_illuminance_is_that_of_the_formula(lamp, intensity):
    points, h = STREET.strip(0.0, STREET.width), STREET.height
    wanted = []
    for x, y in points.T:
        near = [dist((x, y, 0), (a, b, h)) for a, b in lamps(STREET) if abs(a - x) <= 5 * h]
        wanted.append(0.7 * sum(intensity(h / d) * h / d**3 for d in near))
    np.testing.assert_allclose(LitRoad(STREET, lamp).illuminance(points), wanted, rtol=1e-6)


def test_luminance_is_that_of_the_formula():
    points, h, eye = STREET.lane_points, STREET.height, STREET.lane_middles[0]
    wanted = []
    for x, y in points.T:
        seen = 0.0
        for a, b in lamps(STREET):
            if -5 * h <= a - x and hypot(a - x, b - y) <= 12 * h:  # where the table ends
                beta = degrees(abs(atan2(b - y, a - x) - atan2(y - eye, x + 60)))
                seen += (300 + hypot(a - x, b - y) / h * min(beta, 360 - beta)) * 1e-4 / h**2
        wanted.append(0.7 * FLUX / (4 * pi) * seen)
    found = LitRoad(STREET, ISOTROPIC).luminance(points, eye, ROAD)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


@pytest.mark.parametrize("height", [2.5, 8.0])  # of the low lamps the farthest are within 1.5 degrees
def test_glare_is_that_of_the_formula(height):
    road, y = replace(STREET, height=height), 1.75
    veils = []
    for k in range(10):
        eye, veil = k * 2.7 - 2.75 * (height - 1.5), 0.0
        for a, b in lamps(road):
            along, up = a - eye, height - 1.5
            if not 0 < along <= 500 or up > along * tan(radians(20)):
                continue
            d = dist((a, b, height), (eye, y, 1.5))
            cosine = (along * cos(radians(1)) - up * sin(radians(1))) / d
            theta = degrees(acos(cosine))
            light = FLUX / (4 * pi) * cosine / d**2
            if theta > 1.5:
                veil += 9.86 * light / theta**2 * (1 + (23 / 66.4) ** 4)
            else:
                veil += light * (10 / theta**3 + 5 / theta**2 * (1 + (23 / 62.5) ** 4))
        veils.append(veil)
    lit = LitRoad(road, ISOTROPIC)
    assert lit.veiling(y) == pytest.approx(max(veils), rel=1e-9)
    # maintained luminance, initial glare; both laws near 5 cd/m^2
    assert lit.threshold_increment(y, 0.7) == pytest.approx(65 * max(veils), rel=1e-9)
    assert lit.threshold_increment(y, 7.0) == pytest.approx(95 * max(veils) / 10**1.05, rel=1e-9)


def test_the_edge_ratio_of_lamps_over_the_edge_of_a_symmetric_street_is_one():
    """Each edge is a plane of symmetry of the lamps above it; the other row is the less for both strips."""
    one = Installation(8.0, 27.0, lanes=2, rows="right")
    assert LitRoad(one, LAMBERTIAN).edge_ratio() < 1
    far = replace(one, lanes=20, lane_width=4.0, rows="opposite")
    assert LitRoad(far, LAMBERTIAN).edge_ratio() == pytest.approx(1, abs=0.01)


def rough(seed):
    """A lamp without any symmetry."""
    rng = np.random.default_rng(seed)
    light = rng.random((13, 10))
    light[-1] = light[0]
    light[:, 0] = light[0, 0]  # one direction
    return Luminaire(np.linspace(0, 360, 13), np.linspace(0, 90, 10), light)


@examples(8)
@given(st.integers(0, 99), st.floats(-20, 20), st.floats(-3, 5))
def test_the_left_row_is_the_right_one_turned_and_light_falls_with_the_square_of_lengths(seed, tilt, over):
    right = Installation(7.0, 25.0, overhang=over, tilt=tilt)
    points, lamp = right.strip(0.0, 7.0), rough(seed)
    light = LitRoad(right, lamp).illuminance(points)
    turned = np.array([[25.0], [7.0]]) - points
    np.testing.assert_allclose(
        LitRoad(replace(right, rows="left"), lamp).illuminance(turned), light, rtol=1e-9
    )
    twice = replace(right, height=14.0, spacing=50.0, lane_width=7.0, overhang=2 * over)
    np.testing.assert_allclose(4 * LitRoad(twice, lamp).illuminance(2 * points), light, rtol=1e-9)


def test_lamps_over_the_middle_are_staggered_or_not_alike():
    middle = Installation(8.0, 20.0, overhang=3.5)
    points = middle.strip(0.0, 7.0)
    staggered = replace(middle, spacing=40.0, rows="staggered")
    light = LitRoad(middle, LAMBERTIAN).illuminance(points)
    np.testing.assert_allclose(LitRoad(staggered, LAMBERTIAN).illuminance(points), light, rtol=1e-12)


@pytest.mark.parametrize(("rows", "y"), [("right", 9.0), ("left", 5.0)])
@pytest.mark.parametrize(("gamma", "tilt"), [(45.0, 0.0), (0.0, 45.0), (30.0, 15.0)])
def test_c90_and_the_tilt_point_across_the_road(rows, y, gamma, tilt):
    """A beam of 5 degrees at C = 90 from a lamp 1 m over the edge lands 8 m on: there is all light."""
    c, g = np.arange(0, 361, 5.0), np.arange(0, 91, 5.0)
    beam = Luminaire(c, g, (g == gamma) * ((c == 90) | (gamma == 0))[:, None] * 100.0)
    road = Installation(8.0, 1000.0, lanes=4, overhang=1.0, tilt=tilt, rows=rows)
    points = np.array([np.zeros(4), [y, y - 3, y + 3, 14 - y]])
    light = LitRoad(road, beam).illuminance(points)
    assert light[0] == pytest.approx(0.8 * 100 * 8 / (2 * 8**2) ** 1.5, rel=1e-9)
    np.testing.assert_allclose(light[1:], 0, atol=1e-12)


@pytest.mark.parametrize(("spacing", "columns"), [(12, 10), (30, 10), (30.1, 11), (36, 12), (37, 13)])
def test_points_along_are_ten_or_three_metres_apart_at_most(spacing, columns):
    road = Installation(8.0, spacing, lanes=2, lane_width=3.5)
    assert len(road.columns) == columns
    assert road.columns[0] == pytest.approx(spacing / columns / 2)
    assert road.strip(0, 7).shape == (2, 5 * columns)  # 1.4 m apart
    assert road.strip(0, 2).shape == (2, 3 * columns)
    assert sorted(set(road.lane_points[1])) == pytest.approx(3.5 * (np.arange(6) + 0.5) / 3)


def test_an_r_table_is_read_back(tmp_path):
    path = tmp_path / "R.txt"
    path.write_text("\n".join("; ".join(f"{v:.3f}" for v in row) for row in ROAD.r) + "\n\n")
    np.testing.assert_allclose(read_r_table(path).r, ROAD.r, atol=1e-3)
    assert ROAD.specular == 1.0
    assert ROAD.at(np.array([7.0]), np.array([12.1])) == 0


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("1 2 3\n4 5 6\n", r"29 rows \(tan gamma 0 to 12\) of 20 numbers .* got the shape \(2, 3\)"),
        ("1 2 3\n4 5\n", "is no r-table of 29 lines with 20 numbers each: its lines differ in length"),
        ("beta 0 2\n", "is no r-table .*: 'beta' is no number"),
        ("\n".join(["1 " * 20] * 28 + ["-1 " * 20]), "must lie between 0 and 1e.06 .*, got -1 to 1"),
        ("\n".join(["1 " * 20] * 28 + ["1e300 " * 20]), "must lie between 0 and 1e.06 .*, got 1 to 1e.300"),
        ("\n".join(["4_5 " * 20] * 29), "'4_5' is no number"),
        ("\n".join(["0 " * 20] * 29), "light from above, one number greater than 0"),
        ("\n".join([" ".join(map(str, range(1, 21)))] * 29), "rows go by tan gamma, columns by beta"),
    ],
)
def test_what_is_no_r_table_is_refused(tmp_path, text, sentence):
    path = tmp_path / "R.txt"
    path.write_text(text)
    with pytest.raises(UserError, match=sentence) as refused:
        read_r_table(path)
    assert str(path) in str(refused.value)
