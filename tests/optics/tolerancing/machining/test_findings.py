"""What is found of a tool: verdicts, defaults, sentences and data."""

import json
from dataclasses import replace

import numpy as np
import pytest

from optics import UserError
from optics.light.blur import spot_width
from optics.tolerancing.machining import ToolOrder, tool_data, tool_findings, tool_lines
from optics.tolerancing.machining.blur_of_cusps import CuspLight
from optics.tolerancing.machining.findings import _finer_pitch
from tests.optics.cases import example_system, small_lens, small_system
from tests.optics.tolerancing.machining.cases import bowl_lens
from thbcad.sags import Conic
from thbcad.tools import air_side, ball_cusps, ball_fit


@pytest.fixture
def found(tmp_path, backend):
    system = small_system(tmp_path)

    def of(order, lens=None):
        return tool_findings(system.with_lens(lens or bowl_lens()), order, backend, rays=17)

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


@pytest.mark.slow
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


NARROW = {"source.half_width": [5.0, 5.0]}


def test_cusps_are_told_where_light_crosses_and_anywhere(tmp_path, backend):
    """Against the closed form of both: a beam over the middle half of a bowl, whose rim is steep."""
    system = small_system(tmp_path, NARROW)
    lens = small_lens(rear=Conic(-25.0, -1.0))
    found = tool_findings(system.with_lens(lens), ToolOrder(ball=3.0, step=0.05), backend, rays=65)
    (surface,), graph = found.surfaces, air_side(lens, "rear")
    heights = [ball_cusps(graph, x, x, 3.0, 0.05, "x").height.max() for x in map(np.array, ([5.0], [10.0]))]
    assert heights[1] > 1.15 * heights[0]
    assert surface.cusp_height == pytest.approx(heights[0], rel=0.03)
    data = tool_data(found)["surfaces"]["rear"]["cusps"]
    assert data["height_anywhere_mm"] == pytest.approx(heights[1], rel=1e-6)
    (line,) = (line for line in tool_lines(found) if line.startswith("cusps of"))
    assert f"{1e6 * surface.cusp_height:.3g} nm high where light for the target crosses it" in line
    assert f"up to {1e6 * heights[1]:.3g} nm anywhere on it" in line


@pytest.mark.parametrize(("rows", "speed", "step"), [("x", None, 0.004), ("y", 500.0, 0.01)])
def test_rows_metres_and_hours_are_told(found, rows, speed, step):
    """By the arc of a parabola z = x^2 / (2 R), the same in every row."""
    radius, half = 40.0, 10.0
    findings = found(ToolOrder(ball=3.0, step=step, rows=rows, speed=speed), small_lens())
    cut = findings.surfaces[0].rows
    t = half / radius
    arc = half * np.sqrt(1 + t * t) + radius * np.arcsinh(t)
    assert cut.rows == round(2 * half / step) + 1
    assert cut.length == pytest.approx(cut.rows * arc / 1e3, rel=1e-4)
    assert cut.hours == pytest.approx(1e3 * cut.length / (speed or 1000.0) / 60, rel=1e-12)
    (line,) = (line for line in tool_lines(findings) if line.startswith("one pass over the rear"))
    assert f"{cut.rows:,} rows, {cut.length:,.0f} m of cutting" in line
    assert "polishing are not in them" in line
    assert ("as nothing else is said" in line) == (speed is None)


def test_days_of_cutting_have_one_remedy(found):
    long = ToolOrder(ball=3.0, step=0.0005, speed=100.0)
    lines = tool_lines(found(long, small_lens()))
    (remedy,) = (line for line in lines if line.startswith(("rows become fewer", "a lens that is polished")))
    assert remedy.startswith(
        "rows become fewer in proportion to the radius of the ball, of which up to 40 mm"
    )
    tight = tool_lines(found(ToolOrder(ball=38.0, step=0.0005, speed=100.0), small_lens()))
    assert any(line.startswith("a lens that is polished may be cut in coarser rows") for line in tight)


def test_without_rpm_the_turns_are_told(found):
    (line,) = (line for line in tool_lines(found(ToolOrder(nose=1.0, feed=0.01))) if "turns and is" in line)
    assert "--rpm or --acceleration tell its hours" in line


SUN = {"source.divergence": 2.0}
LAMP = {"source.kind": "lambertian", "source.half_width": [0.6, 0.6], "source.distance": 30.0}


@pytest.mark.parametrize("changes", [SUN, LAMP], ids=["sun", "lamp"])
def test_the_yardstick_is_half_of_the_blur_that_there_is(tmp_path, backend, changes):
    """A plane plate: the sun's disk over the way to the target, and the lamp's image by a pinhole."""
    system = small_system(tmp_path, changes)
    lens = small_lens(rear=Conic())
    wide = spot_width(system.with_lens(lens), backend)
    # behind a plate light has the angle that it had before; a lamp is seen over its optical distance
    expected = 2 * 60 * np.tan(np.radians(2.0)) if changes is SUN else 1.2 * 60 / (30 + 6 / 1.5)
    assert wide == pytest.approx(expected, rel=0.1)
    (surface,) = tool_findings(
        system.with_lens(lens), ToolOrder(ball=6.0, surface="rear"), backend, 65
    ).surfaces
    assert surface.yardstick == pytest.approx(wide / 2 / (40 / 48), rel=1e-12)
    assert surface.pitch * surface.blur.worst()[0] == pytest.approx(surface.yardstick)
    assert surface.largest_pitch == pytest.approx(surface.pitch)


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("changes", "times", "why"),
    [
        ({}, 0.99, "at most, and the yardstick is one pixel"),
        ({}, 1.01, "more than one pixel"),
        (SUN, 0.99, "pixels, half of the blur that there is without cusps"),
        (SUN, 1.01, "pixels, half of the blur that there is without cusps"),
    ],
)
def test_polishing_is_asked_for_where_cusps_blur_more_than_the_yardstick(
    tmp_path, backend, changes, times, why
):
    system = small_system(tmp_path, changes)

    def of(step):
        return tool_findings(system.with_lens(bowl_lens()), ToolOrder(ball=5.0, step=step), backend, rays=33)

    half = spot_width(system.with_lens(bowl_lens()), backend) / 2 if changes else 40 / 48
    step = times * max(1.0, half / (40 / 48)) / of(0.01).surfaces[0].blur.worst()[0]
    findings = of(step)
    polish = tool_data(findings)["surfaces"]["rear"]["cusps"]["polish"]
    assert polish["needed"] == (times > 1)
    assert polish["why"] in tool_lines(findings)
    assert polish["why"].startswith(
        "the rear must be polished" if times > 1 else "the rear needs no polishing"
    )
    assert polish["why"].endswith(why)


def test_cusps_that_raise_the_error_by_more_than_a_hundredth_must_be_polished(found):
    """Also where they blur the light by less than a pixel: the text does not contradict its numbers."""
    findings = found(ToolOrder(ball=5.0, step=0.01))
    (surface,) = findings.surfaces
    assert surface.pitch < surface.largest_pitch

    def polish(with_cusps, finer):
        light = CuspLight(surface.light.picture, 0.0002, with_cusps)
        told = replace(findings, surfaces=(replace(surface, light=light, finer=finer),))
        data = tool_data(told)["surfaces"]["rear"]["cusps"]["polish"]
        assert data["why"] in tool_lines(told)
        return data

    coarse, fine = polish(0.0412, (0.0022, 0.0091)), polish(0.0100, None)
    assert coarse["needed"]
    assert coarse["why"].startswith(
        "the rear must be polished, or cut with a smaller step: its cusps raise rel_l2 from 0.0002 to "
        "0.0412, by more than 0.01"
    )
    assert coarse["why"].endswith("those of --step 0.0022 raise it by 0.0091")
    assert not fine["needed"]
    assert "needs no polishing" in fine["why"]


def test_a_finer_step_is_looked_for_until_the_error_rises_by_a_hundredth_at_most():
    def cut_light(pitch):
        return CuspLight(np.ones((1, 1)), 0.002, 0.002 + 0.04 * pitch**power)

    for power, pitch in ((1.0, 0.95 * 0.01 / 0.04), (2.0, 0.95 * 0.01 / 0.04)):
        found, rise = _finer_pitch(cut_light, 1.0, cut_light(1.0))
        assert found == pytest.approx(pitch, rel=1e-2)
        assert rise == pytest.approx(0.04 * found**power, abs=1e-15)
    assert _finer_pitch(cut_light, 0.1, cut_light(0.1)) is None
    power = 0.5
    found, rise = _finer_pitch(cut_light, 1.0, cut_light(1.0))
    assert rise <= 0.01
    assert found < 1 / 16


def test_sharp_light_keeps_the_pixel_as_yardstick(found):
    (surface,) = found(ToolOrder(ball=5.0)).surfaces
    assert surface.yardstick == 1.0


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
        ({"nose": 1.0, "speed": 10.0}, "speed goes with a ball"),
        ({"ball": 1.0, "speed": -1.0}, "speed must be a positive number of mm for each minute"),
        ({"acceleration": 10.0}, "acceleration goes with a nose"),
        ({"ball": 1.0, "rows": "z"}, 'rows must be "x" or "y"'),
        ({"ball": 1.0, "surface": "side"}, 'surface must be "front" or "rear"'),
    ],
)
def test_bad_orders_are_one_sentence(order, sentence):
    with pytest.raises(UserError, match=sentence):
        ToolOrder(**order)


PLATE = {"lens.array.columns": 2, "lens.array.rows": 3, "lens.array.pitch": 25.0, "lens.thickness": 8.0}


def test_of_a_plate_each_lens_is_told_and_no_nose_turns_it(tmp_path, backend):
    system = small_system(tmp_path, PLATE)
    findings = tool_findings(system, ToolOrder(), backend)
    lines = tool_lines(findings)
    assert lines[0].startswith("this holds for each of the 6 lenses of the plate by itself")
    assert not any("walls" in line for line in lines)
    assert tool_data(findings)["lenses"] == 6
    with pytest.raises(UserError, match="this is a plate of lenses; take a ball"):
        tool_findings(system, ToolOrder(nose=0.5, feed=0.02), backend)


def test_the_walls_of_a_body_have_its_draft(backend):
    base = {"lens.rear.radius": -20.0, "lens.rear.conic": -1.0, "lens.rear.freeform.z_freedom": 1.0}
    system = example_system("dome", base)
    findings = tool_findings(system, ToolOrder(), backend)
    assert (
        tool_lines(findings)[-1] == "the walls of the body have a draft of 3 degrees, as lens.body asks for"
    )
    assert tool_data(findings)["draft"]["walls_degrees"] == {}
