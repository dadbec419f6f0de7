"""The report: its summary, numbers with units, the verdict, and what was got where more was wanted."""

import re
from dataclasses import replace
from html import unescape

import pytest

from optics.base.runtime import Check, grade, verification
from optics.light.analysis import Verdict
from optics.reporting.report.html import STYLE, Report, report_html
from optics.reporting.report.metric_words import metric_rows, number_text
from optics.scene.photometry import units_of
from optics.scene.problem import load_problem

METRICS = {
    "rel_l2": 0.1,
    "rel_l2_debiased": 0.098,
    "rel_l2_error": 0.0007,
    "rel_l2_sequential": 0.05,
    "paths": "sequential",
    "efficiency": 0.8,
    "normal_incidence_transmittance": 0.9216,
    "stray": 0.01,
    "dof": 9,
    "evaluations": 3,
    "wall_s": {"total": 1.0},
}


@pytest.fixture
def page(problem_file):
    """A function from further metrics to the report's page."""

    def make(more):
        report = Report(load_problem(problem_file()), METRICS | more, verification([]), [], {})
        return report_html(report, "")

    return make


def test_efficiency_stands_beside_what_two_faces_pass(page):
    passing = "two uncoated faces at normal incidence pass 92.2%"
    assert f"<dd>80 %</dd><dd>of the light of the source; {passing}</dd>" in page({})


def test_every_head_of_a_table_says_what_it_is_the_head_of(page):
    heads = re.findall(r"<th\b([^>]*)>([^<]*)</th>", page({}))
    assert len(heads) >= 9
    assert {scope.strip() for scope, _ in heads} <= {'scope="col"', 'scope="row"'}
    assert all(words.strip() for _, words in heads)


def test_the_error_stands_with_its_noise_and_the_ways_that_count(page):
    assert re.search("<dd>9.8 [+]- 0.07 %</dd><dd>[^<]*; front and rear only</dd>", page({}))
    assert "; all paths</dd>" in page({"paths": "all"})


@pytest.mark.parametrize(
    ("paths", "words"),
    [
        ("sequential", "below 1% it counts nowhere"),
        ("all", "front and rear only make a relative error of 5 %"),
    ],
)
def test_what_other_ways_bring_is_said(page, paths, words):
    text = page({"paths": paths, "nonsequential": {"target_w": 0.7, "by_other_ways": 0.0114}})
    assert "1.14% of the light on the target comes by other ways: " in text
    assert words in text


@pytest.mark.parametrize("more", [{}, {"nonsequential": {"target_w": 0.0, "by_other_ways": 0.0}}])
def test_nothing_is_said_of_what_was_not_traced_or_is_dark(page, more):
    assert "by other ways:" not in page(more)


def judged(problem_file, changes, *checks, notes=(), sentence="", **more):
    """Return the page of a report with these checks."""
    problem = load_problem(problem_file(changes))
    verdict = Verdict(grade(checks), sentence, checks, tuple(notes))
    return report_html(Report(problem, METRICS, verification(checks), [], {}, verdict, **more), "")


def test_the_verdict_and_the_notes_stand_first_and_are_escaped(problem_file):
    page = judged(problem_file, None, sentence="rel_l2 < 0.5 & lit", notes=["<b>dark</b>", "second"])
    assert '<p class="banner good">rel_l2 &lt; 0.5 &amp; lit</p>' in page
    assert "<li>&lt;b&gt;dark&lt;/b&gt;</li><li>second</li>" in page
    assert page.index("banner good") < page.index("Light on the target")


def test_light_that_misses_is_told_where_remedies_stand(problem_file):
    """Light is bound by many things: neither the number nor its limit says what helps."""
    light = Check("rel_l2, without noise", 0.2, 0.1, "", subject="light")
    step = Check("free edges", 2, 0, "")
    pages = [judged(problem_file, None, check) for check in (light, step)]
    assert ["a smaller source, a larger lens" in page for page in pages] == [True, False]


@pytest.mark.parametrize(
    ("check", "colour"),
    [
        (Check("free edges", 2, 0, ""), "bad"),
        (Check("U0", 0.3, 0.7, "", at_least=True, subject="light"), "bad"),
        (Check("U0", 0.71, 0.7, "", at_least=True, error=0.02, subject="light"), "open"),
        (Check("U0", 0.8, 0.7, "", at_least=True, subject="light"), "good"),
    ],
)
def test_the_colour_of_the_banner_is_that_of_the_grade(problem_file, check, colour):
    assert f'<p class="banner {colour}">no</p>' in judged(problem_file, None, check, sentence="no")


def test_without_a_verdict_there_is_no_banner(page):
    assert '<p class="banner' not in page({})


def test_a_failed_check_says_what_was_got_and_wanted(problem_file):
    words = "<li>free edges: got 2, wanted at most 0</li>"
    assert words in judged(problem_file, None, Check("free edges", 2, 0, ""))
    assert words not in judged(problem_file, None, Check("free edges", 0, 0, ""))
    unsure = Check("U0", 0.71, 0.7, "", at_least=True, error=0.02, subject="light", remark="more rays would")
    assert "<li>U0: got 0.71 +- 0.02, wanted at least 0.7; more rays would</li>" in judged(
        problem_file, None, unsure
    )


def test_of_a_missed_limit_a_note_says_more(problem_file):
    check = Check("slope of the rear beyond limits.slope, at x = 1, y = 2", 1.5, 0, "degrees")
    page = judged(
        problem_file, None, check, notes=["the start is poor", "slope of the rear: got 21.5 degrees"]
    )
    (problems,) = re.findall('<ul class="bad">(.*?)</ul>', page)
    assert problems == "<li>slope of the rear: got 21.5 degrees</li>"
    assert '<ul class="notes"><li>the start is poor</li></ul>' in page


def test_every_missed_limit_is_listed_once(problem_file):
    """By a note that tells several causes, of an element by its name, and without a note by the check."""
    missed = ["thickness short of limits.thickness, at x = 1, y = 2", "mass beyond limits.mass"]
    checks = [Check(name, 1.5, 0, "mm") for name in (*missed, f"M1: {missed[0]}", f"M2: {missed[0]}")]
    notes = ["M1: mass: got 3 g; M1: thickness: got 2 mm: --set x=1", "mass: got 9 g; thickness: got 2 mm"]
    page = judged(problem_file, None, *checks, notes=notes)
    (problems,) = re.findall('<ul class="bad">(.*?)</ul>', page)
    assert problems == "".join(
        f"<li>{text}</li>" for text in (f"M2: {missed[0]}: got 1.5 mm, wanted at most 0 mm", *notes)
    )


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.000875993, "%", "0.0876"),
        (0.9215385, "%", "92.2"),
        (1.1e-16, "%", "0"),
        (63.648761, "dB", "63.65"),
        (5.6e-14, "W", "0"),
        (0.038461445, "W", "0.03846"),
        (265300.123, "mm^3", "265300"),
        (1.5e12, "mm", "1.5e+12"),
        (float("inf"), "mm", "infinite"),
        (None, "dB", "not defined"),
        (961, "", "961"),
        ("cells", "", "cells"),
    ],
)
def test_numbers_have_the_digits_that_mean_something(value, unit, text):
    assert number_text(value, unit) == text


def test_every_metric_has_its_unit_and_its_meaning(problem_file):
    fates = {"on_target": 0.8, "off_target": 0.1}
    rows = {
        name: rest
        for name, *rest in metric_rows(METRICS | {"fates_w": fates, "psnr_db": None}, units_of("W"))
    }
    assert rows["rel_l2"][:2] == ["10", "%"]
    assert rows["psnr_db"][:2] == ["not defined", ""]
    assert rows["wall_s total"] == ["1", "s", "wall time of the phase"]
    value, unit, meaning = rows["fates_w on_target"]
    assert (value, unit) == ("0.8", "W")
    assert re.match("light that .*; traced from surface to surface", meaning)
    assert all(meaning for *_, meaning in rows.values())


def test_every_zone_has_a_row():
    zone = {"value": 5200.0, "unit": "cd", "limit": 5100.0, "at_least": True}
    zones = [zone | {"name": "left"}, zone | {"name": "right", "at_least": False}]
    assert list(metric_rows({"zones": zones}, units_of("lm"))) == [
        ("zones left", "5200", "cd", "at least 5100"),
        ("zones right", "5200", "cd", "at most 5100"),
    ]


def test_light_in_lumens_has_its_units_and_its_meaning():
    """Every metric of a lamp in lumens before a plane, and of a far field."""
    beam = {f"{angle}_{plane}": 9.0 for angle in ("beam_angle", "field_angle") for plane in ("c0", "c90")}
    found = {
        "target_mean_lx": 7.0,
        "uniformity": {"min_over_mean": 0.9, "noise": 0.02, "lit_mean_lx": 8.0, "box_mm": [0.5, 0.25]},
        "beam": {"peak_cd": 50.0, "peak_cd_per_klm": 100.0, **beam},
        "fates_lm": {"on_target": 0.8},
        "nonsequential": {"target_lm": 0.8, "fates_lm": {"on_target": 0.8}},
    }
    rows = {name: rest for name, *rest in metric_rows(found, units_of("lm"))}
    units = {name: unit for name, (_, unit, _) in rows.items()}
    assert units["target_mean_lx"] == units["uniformity lit_mean_lx"] == "lx"
    assert (units["beam peak_cd"], units["beam peak_cd_per_klm"]) == ("cd", "cd/klm")
    assert (units["beam beam_angle_c0"], units["uniformity min_over_mean"]) == ("degrees", "")
    fluxes = ("fates_lm on_target", "nonsequential target_lm", "nonsequential on_target")
    assert [units[name] for name in fluxes] == ["lm"] * 3
    assert rows["uniformity box_mm"][:2] == ["0.5 x 0.25", "mm"]
    assert rows["uniformity noise"][:2] == ["2", "%"]
    assert rows["beam field_angle_c90"][2] == "full width at 10% of the peak, plane C90"
    assert all(meaning for *_, meaning in rows.values())


def test_the_view_is_a_page_of_its_own(problem_file):
    view = "<p title=\"a\">1 < 2 &amp; 'b'</p>"
    page = judged(problem_file, None, view=view)
    (held,) = re.findall(r'<iframe [^>]*sandbox="allow-scripts" srcdoc="([^"]*)"></iframe>', page)
    assert unescape(held) == view
    assert "<iframe" not in judged(problem_file, None)


def test_a_still_picture_lies_behind_the_view_and_is_the_only_one_of_the_scene(problem_file):
    """Where the view's program does not run, and on paper, it is seen."""
    report = Report(load_problem(problem_file()), METRICS, verification([]), [], {"scene": ("Scene", b"1")})
    pages = [report_html(replace(report, view=view), "") for view in ("<p>", "")]
    assert all(page.count('alt="Scene"') == 1 for page in pages)
    (still,) = re.findall('<div class="still">(.*?)</div>', pages[0])
    assert still.index("<img") < still.index("<iframe")


def test_no_figure_is_as_narrow_as_its_least_content():
    """A picture of at most the width of a figure that is as wide as its content is some pixels wide."""
    assert "min-content" not in STYLE
