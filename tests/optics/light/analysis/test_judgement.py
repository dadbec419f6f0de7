"""Whether a design does its job, in checks and sentences."""

from math import inf

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.base.runtime import Check, grade
from optics.light.analysis import (
    contrast_error,
    dark_note,
    delivery_checks,
    judged,
    loss_notes,
    rel_l2,
    unjudged_note,
)
from optics.scene.photometry import units_of
from optics.scene.problem import Verify

FATES = dict.fromkeys(
    (
        *("beside_lens", "front_reflected", "missed_rear", "unresolved"),
        *("total_internal", "rear_reflected", "on_target", "off_target"),
    ),
    0.0,
)


PICTURE = {
    "rel_l2_debiased": 0.05,
    "rel_l2_error": 0.0,
    "contrast_error": 0.12,
    "contrast_error_std": 0.0,
    "lit_efficiency": 0.8,
    "efficiency": 0.9,
    "stray": 0.02,
}
BOXES = {
    "min_over_mean": 0.9,
    "min_over_mean_error": 0.0,
    "min_over_max": 0.8,
    "min_over_max_error": 0.0,
    "rsd": 0.03,
    "rsd_error": 0.0,
    "box_mm": [7.0, 7.0],
    "reason": "",
    "noise": 0.0,
}


def picture(**changes):
    return PICTURE | changes


def uniform(**changes):
    bare = {key: value for key, value in PICTURE.items() if not key.startswith("contrast")}
    own = {key: changes.pop(key) for key in list(changes) if key in BOXES}
    return bare | {"rel_l2_debiased": 0.3, "uniformity": BOXES | own} | changes


def graded(values, **limits):
    return judged(values, delivery_checks(values, Verify(**limits)), of_file=False).grade


def test_pictures_are_judged_by_their_error_and_by_what_it_is_of_their_contrast():
    assert graded(picture()) == "made"
    assert graded(picture(rel_l2_debiased=0.11)) == "light misses"
    assert graded(picture(contrast_error=0.26)) == "light misses"
    assert graded(picture(rel_l2_debiased=0.11), rel_l2=0.12) == "made"
    assert graded(picture(contrast_error=0.26), contrast_error=inf) == "made"


def test_even_light_passes_for_no_picture_of_little_contrast():
    """On a picture of contrast 0.1 its rel_l2 is 0.0995, within the limit, and its contrast error 1."""
    rng = np.random.default_rng(1)
    target = 1 + 0.1 * np.sign(rng.normal(size=(64, 64)))
    target += 1 - target.mean()
    even = np.ones_like(target)
    error = rel_l2(even, target)
    assert error == pytest.approx(0.0995, abs=1e-4)
    values = picture(rel_l2_debiased=error)
    values |= contrast_error(values, target)
    assert values["contrast_error"] == pytest.approx(1, rel=1e-12)
    assert graded(values) == "light misses"
    assert contrast_error(values, even) == {"contrast_error": None, "contrast_error_std": None}


@pytest.mark.parametrize(
    ("changes", "grade"),
    [
        ({}, "made"),  # a rel_l2 of 0.3 at its borders is reported, and not judged
        ({"min_over_mean": 0.69}, "light misses"),
        ({"min_over_max": 0.49}, "light misses"),
        ({"rsd": 0.13}, "light misses"),
        ({"lit_efficiency": 0.49}, "light misses"),
        ({"min_over_mean": None, "min_over_max": None, "rsd": None, "reason": "why"}, "not decided"),
    ],
)
def test_uniform_light_is_judged_by_its_boxes(changes, grade):
    assert graded(uniform(**changes)) == grade


def test_a_limit_that_is_taken_off_is_not_judged():
    off = {"min_over_mean": 0.0, "min_over_max": 0.0, "rsd": inf, "lit_efficiency": 0.0}
    assert delivery_checks(uniform(min_over_mean=None, reason="why"), Verify(**off)) == []
    assert graded(uniform(), rel_l2=0.2) == "light misses"
    assert graded(uniform(), stray=0.01) == "light misses"


def test_a_verdict_without_limits_of_uniformity_begins_with_the_lit_efficiency():
    off = {"min_over_mean": 0.0, "min_over_max": 0.0, "rsd": inf}
    verdict = judged(uniform(), delivery_checks(uniform(), Verify(**off)), of_file=False)
    assert verdict.sentence.startswith("80% of the source's light on the lit region (30 % off): ")
    rsd = judged(uniform(), delivery_checks(uniform(), Verify(**off | {"rsd": 0.12})), of_file=False)
    assert rsd.sentence.startswith("U0 0.90 (30 % off): ")


def test_lit_efficiency_counts_the_light_of_the_source_in_metrics_and_limits():
    """93 % are reflected totally; of what passes nearly all arrives: 0.2 had called that well done."""
    assert graded(picture(lit_efficiency=0.06, efficiency=0.065, stray=0.0)) == "light misses"


@given(value=st.floats(0, 1), limit=st.floats(0.01, 0.99), error=st.floats(1e-6, 0.2))
def test_a_value_within_two_standard_errors_of_its_limit_is_not_decided(value, limit, error):
    found = graded(uniform(min_over_mean=value, min_over_mean_error=error), min_over_mean=limit)
    if abs(value - limit) <= 2 * error:
        assert found == "not decided"
    else:
        assert found == ("made" if value > limit else "light misses")


def test_the_rays_are_named_that_would_decide():
    """An error of 0.02 at a distance of 0.01 wants 16 times the rays for 2 standard errors."""
    values = uniform(min_over_mean=0.71, min_over_mean_error=0.02, rays=10**6)
    verdict = judged(values, delivery_checks(values, Verify()), of_file=False)
    (open_one,) = [check for check in verdict.checks if check.result == "undecided"]
    wanted = "about 1.6e+07 rays in place of 1.0e+06 would decide"
    assert open_one.remark == f"{wanted}: more target.pixels are measured by more rays"
    values |= {"rays": 10**6, "pixels": [60, 80]}
    verdict = judged(values, delivery_checks(values, Verify()), of_file=False)
    (open_one,) = [check for check in verdict.checks if check.result == "undecided"]
    assert open_one.remark == f"{wanted}: --set target.pixels=[224,299]"  # 66976 pixels of 240 rays each
    assert "0.71 +- 0.02 (at least 0.7)" in verdict.sentence


def test_one_reason_why_there_is_no_uniformity_is_said_once_with_an_option_to_copy():
    values = uniform(min_over_mean=None, min_over_max=None, rsd=None, reason="the blur is wide")
    checks = delivery_checks(values, Verify())
    assert [check.name for check in checks if check.value is None] == ["uniformity"]
    assert str(judged(values, checks, of_file=False)) == (
        "80% of the source's light on the lit region (30 % off): not decided: uniformity not known (the blur "
        "is wide; or --set verify.min_over_mean=0 --set verify.min_over_max=0 --set verify.rsd=inf judges "
        "without it)"
    )


def test_uniformity_that_is_not_known_decides_nothing_where_other_limits_judge_the_shape():
    values = uniform(min_over_mean=None, min_over_max=None, rsd=None, reason="few", noise=0.02, rays=10**6)
    values["beam"] = BEAM
    assert graded(values) == graded(values, rel_l2=inf) == "not decided"
    (unknown, _) = delivery_checks(values, Verify())
    assert unknown.remark.startswith("few; or --set verify.min_over_mean=0 ")
    assert unjudged_note(values, Verify()) == []
    for other in ({"rel_l2": 0.4}, {"beam_angle": (9.0, 11.0)}, {"field_angle": (0.0, 20.0)}):
        assert graded(values, **other) == "made"
        assert unjudged_note(values, Verify(**other)) == ["uniformity is not judged: few"]
    off = {"min_over_mean": 0.0, "min_over_max": 0.0, "rsd": inf}
    assert graded(values, **off) == "made"
    assert unjudged_note(uniform(), Verify()) == unjudged_note(picture(), Verify()) == []


BEAM = {f"{name}_{plane}": 10.0 for name in ("beam_angle", "field_angle") for plane in ("c0", "c90")}


@pytest.mark.parametrize(
    ("changes", "grade"),
    [
        ({}, "made"),
        ({"beam_angle_c90": 11.1}, "light misses"),
        ({"beam_angle_c0": 8.9}, "light misses"),
        ({"beam_angle_c0": 10.9, "beam_angle_c0_error": 0.06}, "not decided"),
        ({"beam_angle_c90": None}, "not decided"),
        ({"field_angle_c0": 30.0}, "made"),
    ],
)
def test_the_angles_of_a_beam_are_judged_in_both_planes(changes, grade):
    values = uniform(beam=BEAM | changes)
    assert graded(values, beam_angle=(9.0, 11.0)) == grade
    assert graded(values) == "made"


@pytest.mark.parametrize(
    ("bound", "limits", "result"),
    [
        (18.0, (9.0, inf), "passed"),
        (18.0, (9.0, 11.0), "failed"),
        (18.0, (0.0, 11.0), "failed"),
        (18.0, (9.0, 20.0), "undecided"),
        (18.0, (20.0, inf), "undecided"),
        (None, (9.0, inf), "undecided"),
    ],
)
def test_a_beam_beyond_the_target_is_judged_by_its_width_within(bound, limits, result):
    values = uniform(beam=BEAM | {"beam_angle_c0": None, "beam_angle_c0_at_least": bound})
    check = next(iter(delivery_checks(values, Verify(beam_angle=limits))))
    assert check.name == "beam angle in C0-C180"
    assert check.result == result
    assert check.remark == "the light goes on beyond the target; make target.half_width larger"


def test_the_verdict_begins_with_the_angles_where_they_are_judged():
    values = uniform(beam=BEAM | {"beam_angle_c0": 9.4})
    checks = delivery_checks(values, Verify(beam_angle=(9.0, 11.0)))
    assert str(judged(values, checks, of_file=False)).startswith(
        "beam angle 9.4 x 10 degrees, U0 0.90 (30 % off): "
    )
    checks = delivery_checks(values, Verify(rel_l2=0.4))
    assert str(judged(values, checks, of_file=False)).startswith("30 % off, U0 0.90: ")


def test_a_file_that_has_no_more_rays_is_not_asked_for_pixels():
    values = uniform(min_over_mean=0.71, min_over_mean_error=0.02, rays=4000, rays_of_file=4000)
    found = next(iter(delivery_checks(values, Verify())))
    assert found.remark == "about 6.4e+04 rays in place of 4.0e+03 would decide: source.file has no more"


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


def test_much_light_in_the_dark_names_the_key_that_charges_it():
    """A tenth of the light on the target is too little for a note."""
    (note,) = dark_note({"efficiency": 0.8, "lit_efficiency": 0.6})
    assert note.startswith("25% of the light on the target is where none is asked for")
    assert "optimizer.dark_flux_weight" in note
    assert dark_note({"efficiency": 0.8, "lit_efficiency": 0.73}) == []
    assert dark_note({"efficiency": 0.0, "lit_efficiency": 0.0}) == []


def test_the_worst_of_all_checks_is_the_grade():
    """A file that fails comes before light that misses, and that before what is not decided."""
    good, light = Check("a", 0, 1, ""), Check("b", 0.3, 0.2, "", subject="light")
    file, unknown = Check("c", 0.73, 0.5, "mm"), Check("d", None, 1, "", subject="light")
    assert grade([good]) == grade([]) == "made"
    assert grade([good, unknown]) == "not decided"
    assert grade([unknown, light]) == "light misses"
    assert grade([file, unknown, light]) == "file or part fails"


def test_the_verdict_begins_with_the_numbers_and_names_the_first_check_that_decided():
    good, light = Check("a", 0, 1, ""), Check("b", 0.3, 0.2, "", subject="light")
    file, more = Check("c", 0.73, 0.5, "mm"), Check("e", 2, 1, "", subject="light")
    lit = Check("d", 0.1, 0.2, "", subject="light")
    assert str(judged(picture(), [good, lit])) == (
        "5 % off: the lens makes the light asked for, and the file is the lens"
    )
    assert str(judged(picture(), [good, lit], of_file=False)).endswith("the light asked for")
    assert str(judged(picture(), [good])) == (
        "90.0% of the light arrives on the target: no limit of the light is set, and the file is the lens"
    )
    even = Check("uniformity", 0.3, 0.2, "", subject="light")
    assert str(judged(uniform(min_over_mean=0.31), [even, more])) == (
        "U0 0.31 (30 % off): the light misses what was asked for: uniformity 0.3 (at most 0.2), and 1 more"
    )
    assert str(judged(uniform(), [light])).startswith("30 % off: the light misses")
    assert str(judged(picture(rel_l2_error=0.004), [light, file])) == (
        "5 +- 0.4 % off: the file, the part or a limit of making fails: c 0.73 mm (at most 0.5)"
    )


def test_light_as_near_as_its_blur_allows_still_misses():
    values = picture(rel_l2_debiased=0.21, rel_l2_one_blur=0.2)
    verdict = judged(values, delivery_checks(values, Verify()))
    assert verdict.grade == "light misses"
    assert verdict.sentence.endswith("0.21 is as near as the blur allows (0.2), and not what was asked for")
    far = judged(values | {"rel_l2_debiased": 0.3}, delivery_checks(values, Verify()))
    assert "as near as" not in far.sentence


def test_what_forbids_the_picture_is_named():
    """The sharper of two bounds speaks: as near as it allows, or that no lens comes below the limit."""
    values = picture(rel_l2_debiased=0.21, rel_l2_one_blur=0.15, rel_l2_by_etendue=0.2)
    assert judged(values, delivery_checks(values, Verify())).sentence.endswith(
        "0.21 is as near as etendue allows (0.2), and not what was asked for"
    )
    far = values | {"rel_l2_debiased": 0.3}
    assert judged(far, delivery_checks(far, Verify())).sentence.endswith("; etendue allows 0.2 at best")
    allowed = far | {"rel_l2_one_blur": 0.05, "rel_l2_by_etendue": None}
    assert "allows" not in judged(allowed, delivery_checks(allowed, Verify())).sentence
