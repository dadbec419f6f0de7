"""The main numbers of a report: in percent, with units, and in words."""

import pytest

from optics.reporting.report.metric_words import key_list, key_numbers
from optics.scene.photometry import units_of

METRICS = {
    "rel_l2_debiased": 0.0286,
    "efficiency": 0.921,
    "normal_incidence_transmittance": 0.9216,
    "stray": 0.000154,
    "dof": 46051,
    "wall_s": {"total": 7.04},
}


@pytest.mark.parametrize(
    ("more", "unit", "name", "value"),
    [
        ({}, "W", "Difference from the light asked for", "2.86 %"),
        ({}, "W", "Light on the target", "92.1 %"),
        ({}, "W", "Stray light", "0.0154 %"),
        ({"target_mean_w_m2": 23.03}, "W", "Mean irradiance", "23.03 W/m^2"),
        ({"target_mean_lx": 500.0}, "lm", "Mean illuminance", "500 lx"),
        ({}, "W", "Free numbers", "46051"),
        ({}, "W", "Time", "7.0 s"),
        ({"wall_s": {"total": 220.7}}, "W", "Time", "3 min 41 s"),
    ],
)
def test_a_number_has_its_unit(more, unit, name, value):
    found = {n: v for n, v, _ in key_numbers(METRICS | more, units_of(unit))}
    assert found[name] == value
    assert ("Mean" in " ".join(found)) == any(key.startswith("target_mean") for key in more)


def test_every_number_says_what_it_means():
    page = key_list(METRICS, units_of("W"))
    assert page.count("<dt>") == 5
    assert page.count("<dd>") == 2 * 5
    assert "<dd></dd>" not in page
