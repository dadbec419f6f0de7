"""Intensities in two planes, widths of beams, units of light, and the tables of standards."""

from math import acos, degrees, log, sqrt

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.scene.photometry import BEAM, FIELD, REGULATIONS, plane_curves, regulation, units_of
from optics.scene.photometry.intensity_planes import PlaneCurve
from optics.scene.problem import Target

FORMULAS = {BEAM: degrees(2 * acos(0.5)), FIELD: degrees(2 * acos(0.1))}


def angles(half_width, pixels):
    """Return the centres u of columns, ascending, and v of rows, falling, degrees."""
    u, v = (h * (2 * np.arange(n) + 1 - n) / n for h, n in zip(half_width, pixels))
    return u, v[::-1]


def cosine_to_axis(u, v):
    """Return cos gamma of the directions whose angles in the planes are u and v, (rows, columns)."""
    a, b = np.tan(np.radians(u))[None, :], np.tan(np.radians(v))[:, None]
    return 1 / np.sqrt(1 + a * a + b * b)


@pytest.mark.parametrize("pixels", [(801, 801), (800, 600)])
def test_a_cosine_intensity_has_a_beam_of_120_degrees(pixels):
    """To what linear interpolation between samples leaves: h^2 / 8 of curvature 1, over the slope sin gamma;
    rows beside the axis are off by h / 2 each."""
    u, v = angles((89.0, 89.0), pixels)
    curves = plane_curves(cosine_to_axis(u, v), u, v)
    step = max(np.radians(178.0 / n) for n in pixels)
    for curve in curves.values():
        for share, wanted in FORMULAS.items():
            assert curve.width(share) == pytest.approx(wanted, abs=2 * degrees(step**2))


@given(
    sigmas=st.tuples(st.floats(2.0, 8.0), st.floats(2.0, 8.0)),
    centre=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
    share=st.floats(0.05, 0.9),
)
def test_a_gaussian_beam_is_as_wide_as_its_formula(sigmas, centre, share):
    """2 sigma sqrt(2 ln(1 / share)), in each plane its own, wherever the beam points to; samples are
    sigma / 40 apart or finer, so the peak is missed by less than 1e-4 of it."""
    u, v = angles((30.0, 30.0), (1201, 1201))
    image = np.exp(
        -(((u[None, :] - centre[0]) / sigmas[0]) ** 2) / 2 - ((v[:, None] - centre[1]) / sigmas[1]) ** 2 / 2
    )
    for curve, sigma in zip(plane_curves(image, u, v).values(), sigmas):
        assert curve.width(share) == pytest.approx(2 * sigma * sqrt(2 * log(1 / share)), rel=2e-3)


def test_c0_is_towards_plus_x_and_c90_towards_minus_y():
    u, v = angles((20.0, 10.0), (40, 30))
    image = np.exp(-((u[None, :] - 5) ** 2) / 8 - (v[:, None] - 3) ** 2 / 8)
    curves = plane_curves(image, u, v)
    peaks = {name: curve.gamma[curve.intensity.argmax()] for name, curve in curves.items()}
    assert peaks["C0-C180"] == pytest.approx(5, abs=0.5)
    assert peaks["C90-C270"] == pytest.approx(-3, abs=0.34)


def test_a_batwing_is_measured_between_its_outer_slopes():
    """Peaks of 10 at +-30 degrees that fall to 0 within 10 degrees, and 1 between them."""
    gamma = np.linspace(-60, 60, 121)
    curve = PlaneCurve(gamma, np.interp(np.abs(gamma), [0, 20, 30, 40, 60], [1.0, 1, 10, 0, 0]))
    assert curve.width(BEAM) == pytest.approx(70, abs=1e-9)
    assert curve.width(FIELD) == pytest.approx(78, abs=1e-9)


def test_light_that_goes_on_beyond_the_angles_has_no_width():
    gamma = np.linspace(-10, 10, 21)
    curve = PlaneCurve(gamma, 20.0 - np.abs(gamma))
    assert curve.width(0.6) == pytest.approx(16, abs=1e-12)
    assert curve.width(0.5) is None
    for side in (1, -1):
        assert PlaneCurve(gamma, np.maximum(side * gamma, 0.0)).width(BEAM) is None


@pytest.mark.parametrize("value", [0.0, -1e-20])
def test_darkness_has_no_width(value):
    assert PlaneCurve(np.linspace(-10, 10, 21), np.full(21, value)).width(BEAM) is None


@pytest.mark.parametrize(
    ("flux", "plane", "far", "name"),
    [("W", "W/m^2", "W/sr", "fates_w"), ("lm", "lx", "cd", "fates_lm")],
)
def test_watts_and_lumens_have_their_own_words(flux, plane, far, name):
    units = units_of(flux)
    assert (units.flux, units.key("fates"), units.luminous) == (flux, name, flux == "lm")
    assert (units.density(False).shown, units.density(True).shown) == (plane, far)
    assert (units.density(False).stored, units.density(True).stored) == (f"{flux}/mm^2", f"{flux}/degree^2")


def test_a_flux_on_a_square_metre_and_in_a_small_square_of_directions():
    """12 W on 1 m^2; and 3 lm in 0.01 x 0.02 rad around the axis, where angles and solid angles agree."""
    assert units_of("W").in_plane.text(12 / 1000**2) == "12 W/m^2"
    stored = 3 / np.prod(np.degrees([0.01, 0.02]))
    assert units_of("lm").in_far_field.factor * stored == pytest.approx(3 / (0.01 * 0.02), rel=1e-14)


@pytest.mark.parametrize("name", REGULATIONS)
def test_a_table_names_its_text_its_edition_and_who_compared_it(name):
    table = regulation(name)
    assert all(len(words) > 20 for words in (table.text, table.edition, table.compared))
    assert table.unit == "cd"


@pytest.mark.parametrize("name", REGULATIONS)
def test_a_table_is_its_own_mirror_image_so_that_no_side_of_the_road_is_meant(name):
    """One that is not would need `target.seen_from`: H counts to the right of a driver."""
    points = {
        (h, v, z.get("least", 0), z.get("greatest"))
        for z in regulation(name).zone
        for h, v in z.get("points", ())
    }
    assert {(-h, *rest) for h, *rest in points} == points


def test_ub2_has_19_points_and_what_class_b_asks_of_its_greatest_intensity():
    target = {"kind": "zones", "distance": float("inf"), "half_width": (16.0, 8.0)}
    zones = Target(regulation="FMVSS 108 UB2", **target).zones
    assert sum(len(zone.points) for _, zone in zones) == 19
    at = {point: (zone.least, zone.greatest) for _, zone in zones for point in zone.points}
    assert at[0, 0] == (40000, 75000)
    assert at[-9, -1.5] == (2000, float("inf"))
    assert at[0, -4] == (0, 12000)
    (name, peak), (_, middle), *_ = Target(regulation="UN R149 class B driving", **target).zones
    assert name == "UN R149 class B driving Imax"
    assert (peak.peak, peak.least, peak.greatest, middle.least_of_peak) == (True, 40500, 215000, 0.8)
    assert "nobody has compared it with the text of R149" in regulation("UN R149 class B driving").compared
