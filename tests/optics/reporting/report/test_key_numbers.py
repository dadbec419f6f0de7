"""The main numbers of a report: in percent, with units, and in words."""

import pytest

from optics.reporting.report.metric_words import effort_sentence, key_list, key_numbers
from optics.scene.photometry import units_of

METRICS = {
    "rel_l2_debiased": 0.0286,
    "rel_l2_error": 1e-6,
    "paths": "sequential",
    "efficiency": 0.921,
    "lit_efficiency": 0.917,
    "normal_incidence_transmittance": 0.9216,
    "stray": 0.000154,
    "dof": 46051,
    "evaluations": 61,
    "wall_s": {"total": 7.04},
}
UNIFORM = {"uniformity": {"min_over_mean": 0.98765, "lit_mean_lx": 512.3}, "target_mean_lx": 300.0}


@pytest.mark.parametrize(
    ("more", "unit", "name", "value"),
    [
        ({}, "W", "Difference from the light asked for", "2.86 %"),
        ({"rel_l2_error": 0.002}, "W", "Difference from the light asked for", "2.86 +- 0.2 %"),
        ({}, "W", "Light on the target", "92.1 %"),
        ({}, "W", "Stray light", "0.0154 %"),
        ({"target_mean_w_m2": 23.03}, "W", "Mean irradiance", "23.03 W/m^2"),
        ({"target_mean_lx": 500.0}, "lm", "Mean illuminance", "500 lx"),
        (UNIFORM, "lm", "Uniformity U0", "0.9877"),
        (UNIFORM, "lm", "Mean illuminance", "512.3 lx"),
        (UNIFORM, "lm", "Light on the lit region", "91.7 %"),
    ],
)
def test_a_number_has_its_unit(more, unit, name, value):
    found = {n: v for n, v, _ in key_numbers(METRICS | more, units_of(unit))}
    assert found[name] == value
    assert ("Mean" in " ".join(found)) == any(key.startswith("target_mean") for key in more)


def test_uniform_light_is_told_by_its_uniformity_first():
    """A picture has none, nor has a target too small for the boxes: those are told by their difference."""
    first = {
        name: next(key_numbers(METRICS | more, units_of("lm")))[0]
        for name, more in {
            "uniform": UNIFORM,
            "picture": {},
            "small": {"uniformity": {"min_over_mean": None, "reason": "too small"}},
        }.items()
    }
    assert first == {
        "uniform": "Uniformity U0",
        "picture": "Difference from the light asked for",
        "small": "Difference from the light asked for",
    }


@pytest.mark.parametrize(("seconds", "text"), [(7.04, "; 7.0 s from"), (220.7, "; 3 min 41 s from")])
def test_what_a_design_took_is_one_sentence(seconds, text):
    sentence = effort_sentence(METRICS | {"wall_s": {"total": seconds}})
    assert sentence.startswith("46051 coefficients of splines, chosen by 61 evaluations")
    assert text in sentence


@pytest.mark.parametrize(("more", "count"), [({}, 3), (UNIFORM, 5)])
def test_every_number_says_what_it_means(more, count):
    page = key_list(METRICS | more, units_of("W" if not more else "lm"))
    assert page.count("<dt>") == count
    assert page.count("<dd>") == 2 * count
    assert "<dd></dd>" not in page
