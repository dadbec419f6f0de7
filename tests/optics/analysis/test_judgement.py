"""Whether a design does its job, in checks and sentences."""

from __future__ import annotations

import pytest

from optics.analysis import delivery_checks, loss_notes, verdict
from optics.photometry import units_of
from optics.problem import Verify
from optics.runtime import Check

FATES = dict.fromkeys(
    (
        *("beside_lens", "front_reflected", "missed_rear", "unresolved"),
        *("total_internal", "rear_reflected", "on_target", "off_target"),
    ),
    0.0,
)


def metrics(rel_l2=0.1, lit=0.8, efficiency=0.9, stray=0.0):
    return {"rel_l2": rel_l2, "lit_efficiency": lit, "efficiency": efficiency, "stray": stray}


def passed(values, **limits):
    return [check.ok for check in delivery_checks(values, Verify(**limits))]


def test_a_design_is_judged_by_its_error_and_by_its_light_on_the_lit_pixels():
    assert passed(metrics()) == [True, True]
    assert passed(metrics(rel_l2=0.73)) == [False, True]
    assert passed(metrics(lit=0.3)) == [True, False]
    assert passed(metrics(rel_l2=0.73), rel_l2=0.8) == [True, True]
    assert passed(metrics(lit=0.3), lit_efficiency=0.3) == [True, True]


def test_light_that_never_leaves_the_lens_is_not_counted_as_missing_the_target():
    """93 % are reflected totally; of what passes, nearly all arrives."""
    assert passed(metrics(lit=0.06, efficiency=0.065)) == [True, True]
    assert passed(metrics(lit=0.06, efficiency=0.065, stray=0.1)) == [True, False]


def test_a_lens_that_passes_nothing_misses():
    assert passed(metrics(lit=0.0, efficiency=0.0)) == [True, False]


@pytest.mark.parametrize(
    ("fate", "sentence"),
    [
        ("total_internal", "93% of the light is reflected totally at the rear"),
        ("beside_lens", "93% of the light passes beside the lens"),
        ("missed_rear", "93% of the light meets an edge instead of the rear"),
        ("off_target", "93% of the light leaves by the rear and passes beside the target"),
    ],
)
def test_much_lost_light_is_named(fate, sentence):
    assert loss_notes({"fates_w": FATES | {fate: 1.86, "on_target": 0.14}}, units_of("W")) == [sentence]


def test_fresnel_losses_and_small_ones_are_not():
    fates = FATES | {"rear_reflected": 0.5, "on_target": 0.45, "off_target": 0.05}
    assert loss_notes({"fates_lm": fates}, units_of("lm")) == []


def test_the_verdict_names_the_first_check_that_failed():
    good, bad, worse = Check("a", 0, 1, ""), Check("b", 0.73, 0.5, "mm"), Check("c", 2, 1, "")
    assert verdict([good]).startswith("every check passed")
    assert verdict([good, bad]) == "the design misses b: 0.73 mm (at most 0.5)"
    assert verdict([good, bad, worse]).endswith("(at most 0.5), and 1 more")
