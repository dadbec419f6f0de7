"""What is found of a tool: verdicts, defaults, sentences and data."""

import json

import numpy as np
import pytest

from optics import UserError
from optics.problem import load_problem
from optics.system import OpticalSystem
from optics.toolpaths import ToolOrder, tool_data, tool_findings, tool_lines
from tests.optics.cases import small_lens, write_problem
from tests.optics.toolpaths.cases import bowl_lens
from thbcad.sags import Conic
from thbcad.tools import air_side, ball_fit


@pytest.fixture
def found(tmp_path, backend):
    system = OpticalSystem(load_problem(write_problem(tmp_path)))

    def of(order, lens=None):
        return tool_findings(system, lens or bowl_lens(), order, backend, rays=17)

    return of


def test_the_default_feed_blurs_by_one_pixel_where_it_blurs_most(found):
    findings = found(ToolOrder(nose=1.0))
    (surface,) = findings.surfaces
    assert surface.pitch * surface.blur.worst()[0] == pytest.approx(1.0)
    assert surface.pitch == pytest.approx(surface.largest_pitch)
    (line,) = (line for line in tool_lines(findings) if line.startswith("cusps"))
    assert "blur the light by up to 1 pixels" in line


def test_a_tool_that_fits_passes_and_one_that_does_not_fails_with_the_amount(found):
    (good,) = found(ToolOrder(ball=5.0)).checks
    (bad,) = found(ToolOrder(ball=45.0), small_lens()).checks
    assert good.ok
    assert not bad.ok
    assert bad.value == pytest.approx(5.0, abs=1e-3)  # the bowl has a radius of 40 mm


def test_between_the_bounds_the_sentence_says_so_and_the_check_fails(found):
    least = ball_fit(air_side(bowl_lens(), "rear"), 1.0).least
    middle = (least.lower + least.upper) / 2
    findings = found(ToolOrder(ball=middle))
    assert tool_lines(findings)[0].startswith("it is undecided whether a ball end of")
    assert not findings.checks[0].ok
    assert tool_data(findings)["surfaces"]["rear"]["fit"] == "undecided"


def test_rpm_beyond_the_machine_fails_and_the_highest_rpm_passes(found):
    limit = 2.0
    order = ToolOrder(nose=1.0, feed=0.01, acceleration=limit)
    motion = found(order).surfaces[0].motion
    assert motion.greatest == max(motion.kernel.upper, motion.gaps.worst()[0])
    highest = motion.highest_rpm(limit)
    for rpm, ok in ((0.999 * highest, True), (1.001 * highest, False)):
        checks = found(ToolOrder(nose=1.0, feed=0.01, acceleration=limit, rpm=rpm)).checks
        assert [c.ok for c in checks] == [True, ok]


def test_what_is_not_known_is_a_sentence(found):
    """No motion is given for a nose that does not fit, nor cusps where it fits nowhere."""
    findings = found(ToolOrder(nose=60.0, rpm=100.0), small_lens())
    lines = tool_lines(findings)
    assert lines[0].startswith(
        "a nose of 60 mm does not fit the rear for certain: the least concave radius of"
    )
    assert "cusps on the rear are unknown: no light for the target crosses it where the tool fits" in lines
    assert "how a tool turns the rear is unknown: it is not proven to fit" in lines
    data = tool_data(findings)["surfaces"]["rear"]
    assert data["cusps"] is None
    assert data["spiral"] is None


def test_data_are_strict_json_also_where_nothing_is_concave(found):
    findings = found(ToolOrder(nose=1.0, feed=0.01, rpm=60.0), small_lens(rear=Conic(-40.0, -1.0)))
    data = json.loads(json.dumps(tool_data(findings), allow_nan=False))
    assert data["surfaces"]["rear"]["fit"] == "fits"
    assert data["surfaces"]["rear"]["spiral"]["hours"] == pytest.approx(np.hypot(10, 10) / 0.01 / 3600)
    assert tool_lines(findings)[0] == "a nose of 1 mm fits the rear for certain: nothing is concave"


def test_planes_are_looked_at_when_they_are_named(found):
    assert [s.name for s in found(ToolOrder(ball=5.0)).surfaces] == ["rear"]
    (front,) = found(ToolOrder(ball=5.0, surface="front")).surfaces
    assert front.name == "front"
    assert front.fit.proven


def test_without_a_tool_draft_angles_are_left(found):
    findings = found(ToolOrder())
    assert findings.surfaces == ()
    assert len(tool_lines(findings)) == 3
    assert tool_data(findings)["draft"]["front_degrees"]["value"] == 90.0


@pytest.mark.parametrize(
    ("order", "sentence"),
    [
        ({"ball": 0.0}, "ball must be a positive number of mm, got 0.0"),
        ({"nose": float("nan")}, "nose must be a positive number of mm, got nan"),
        ({"nose": 1.0, "rpm": 1e300}, "rpm must be from 1e-06 to 1e\\+06 revolutions"),
        ({"ball": 1e-300}, "ball must be from 1e-06"),
        ({"ball": "3"}, "ball must be a positive number of mm, got '3'"),
        ({"ball": 1.0, "step": float("inf")}, "step must be a positive number of mm"),
        ({"ball": 1.0, "nose": 1.0}, "give a ball or a nose, not both"),
        ({"nose": 1.0, "step": 0.1}, "step goes with a ball; give the radius of one"),
        ({"ball": 1.0, "rpm": 10.0}, "rpm goes with a nose"),
        ({"acceleration": 10.0}, "acceleration goes with a nose"),
        ({"ball": 1.0, "rows": "z"}, 'rows must be "x" or "y"'),
        ({"ball": 1.0, "surface": "side"}, 'surface must be "front" or "rear"'),
    ],
)
def test_bad_orders_are_one_sentence(order, sentence):
    with pytest.raises(UserError, match=sentence):
        ToolOrder(**order)
