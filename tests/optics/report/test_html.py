"""The report's summary: efficiency beside its bound, and whether the sequential tracer suffices."""

import pytest

from optics.problem import load_problem
from optics.report.html import Report, report_html

METRICS = {
    "rel_l2": 0.1,
    "efficiency": 0.8,
    "efficiency_bound": 0.9216,
    "stray": 0.01,
    "dof": 9,
    "evaluations": 3,
    "wall_s": {"total": 1.0},
}


@pytest.fixture
def page(problem_file):
    """A function from further metrics to the report's page."""

    def make(more):
        report = Report(load_problem(problem_file()), METRICS | more, {"ok": True, "checks": []}, [], {})
        return report_html(report, "")

    return make


def test_efficiency_stands_beside_its_bound(page):
    assert "80.0% of the source flux inside the target (at most 92.2% passes two uncoated faces)" in page({})


@pytest.mark.parametrize(("direct", "words"), [(0.694, "0.86% of"), (0.692, "1.14% of")])
def test_the_sequential_tracer_suffices_up_to_a_hundredth(page, direct, words):
    text = page({"nonsequential": {"lit_w": 0.7, "lit_direct_w": direct}})
    assert words in text
    assert ("does not suffice" in text) == (direct == 0.692)


@pytest.mark.parametrize("more", [{}, {"nonsequential": {"lit_w": 0.0, "lit_direct_w": 0.0}}])
def test_nothing_is_said_of_what_was_not_traced_or_is_dark(page, more):
    assert "suffice" not in page(more)
