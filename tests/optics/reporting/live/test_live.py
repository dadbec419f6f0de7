"""The page of a run: when it is written, and what it says."""

import re
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

from optics.base.runtime import ProgressEvent
from optics.designing.optimisation import Listener, Row, stages
from optics.reporting.live.live_page import NOT_FRESH, SECONDS, LiveState, LiveView, live_page
from optics.scene.receivers import merged
from tests.optics.cases import WIDE, picture, small_system

page = import_module("optics.reporting.live.live_page")
EVENT = ProgressEvent("level 1", 3.0, "289 DOF", 0.25, 42.0)
ROWS = [Row(0, 100, k, 0.0, fit, 0.0, stage=k // 3) for k, fit in enumerate((0.8, 0.4, 0.2, 0.3, 0.1))]
REFRESH = 'http-equiv="refresh"'


@pytest.fixture
def watched():
    """A LiveView with its pages and the time, which a test sets."""
    pages, clock = [], SimpleNamespace(now=0.0)
    return LiveView(pages.append, lambda: clock.now), pages, clock


def test_a_page_comes_at_once_and_then_every_two_seconds_at_most(watched):
    view, pages, clock = watched
    view(EVENT)
    assert pages == []  # nothing has begun
    view.begin("lens")
    for clock.now in (0.1, 1.9, SECONDS, 2.1, 3.9, 2 * SECONDS):
        view(EVENT)
    assert len(pages) == 3


def test_rows_reach_the_page_and_the_listener_that_was_there(watched):
    view, pages, clock = watched
    told = []
    view.begin("lens")
    listener = view.watching(Listener(progress=lambda plan, stage, dof, row: told.append(row)), None)
    for row in (None, *ROWS):
        listener.progress((), None, 100, row)
    clock.now = SECONDS
    view(EVENT)
    assert told == [None, *ROWS]
    assert pages[-1].count("<path") == 2  # a line for each stage


def test_a_page_that_is_not_asked_for_hears_and_costs_nothing(watched):
    view, pages, _ = watched
    listener = Listener()
    assert view.watching(listener, None) is listener
    view(EVENT)
    view.stop("stopped")
    view.done()
    assert pages == []


def test_the_page_of_a_stopped_run_says_why_and_stays(watched):
    view, pages, _ = watched
    view.begin("lens")
    view.stop("to go on: thbcad design <a> --resume")
    view(EVENT)
    view.stop("something else")
    assert [REFRESH in page for page in pages] == [True, False]
    assert "to go on: thbcad design &lt;a&gt; --resume" in pages[-1]


def test_a_page_that_cannot_be_written_ends_no_design():
    def full(page):
        raise OSError(28, "no space left on device")

    view = LiveView(full)
    view.begin("lens")
    view.done()


def test_a_page_says_how_far_the_run_is_and_that_its_numbers_are_not_the_verdict():
    page = live_page(LiveState("<lens>", EVENT, ROWS, ["rel_l2 0.1 so far."], [("Light", b"png")]))
    assert "level 1: 289 DOF; 25% done, about 40 s left" in page
    assert "&lt;lens&gt;" in page
    assert "<lens>" not in page
    assert "rel_l2 0.1 so far." in page
    assert NOT_FRESH in page
    assert NOT_FRESH not in live_page(LiveState("lens", EVENT, ROWS))  # there are no numbers yet


def test_pages_need_no_file_but_the_report():
    pages = live_page(LiveState("lens", EVENT, ROWS, pictures=[("Light", b"png")])) + live_page(
        LiveState("lens", EVENT, done=True)
    )
    links = re.findall(r'(?:src|href|url)="?=?([^"]+)"', pages)
    assert {link.partition(",")[0] for link in links} == {"data:image/png;base64", "report.html"}


def test_the_misfit_falls_from_the_top_to_the_bottom_of_its_curve():
    page = live_page(LiveState("lens", EVENT, ROWS))
    heights = [
        float(y) for path in re.findall(r'd="M([^"]*)"', page) for _, y in re.findall(r"(\S+) ([\d.]+)", path)
    ]
    assert heights[0] == 0  # 0.8, the greatest
    assert heights[-1] == max(heights)  # 0.1, the least
    assert heights[2] - heights[1] == pytest.approx(heights[1] - heights[0], abs=0.11)  # it is logarithmic


def test_in_the_far_field_the_page_speaks_of_intensities_as_the_verdict_does(tmp_path, monkeypatch):
    """Equal intensities everywhere are as uniform as can be; as irradiances they are 0.77 in the corners."""
    system = small_system(tmp_path, WIDE)
    stage = stages(system, False)[-1]
    target = system.target.irradiance(stage.screen, 1.0)
    light = merged(target, stage.parts)
    asked = SimpleNamespace(target=stage.screen.pad(target), image=lambda coefficients: light)
    monkeypatch.setattr(page, "stage_objective", lambda *_: asked)
    said = " ".join(page._light(stage, system, target, None)["so_far"])
    assert "rel_l2 0 so far" in said
    assert "U0 = I_min/I_mean 1 so far" in said


def test_where_pixels_have_parts_the_page_reads_whole_pixels_as_the_verdict_does(tmp_path, monkeypatch):
    fine = {"lens.rear.freeform.spans": [7, 7], "lens.rear.freeform.max_level": 3, "target.pixels": [24, 24]}
    system = small_system(tmp_path, fine)
    stage = stages(system, True)[-1]
    assert stage.parts == 3
    target, light = system.target.irradiance(stage.screen, 1.0), picture(24, 24)
    asked = SimpleNamespace(target=stage.screen.pad(target), image=lambda coefficients: light)
    monkeypatch.setattr(page, "stage_objective", lambda *_: asked)
    said = " ".join(page._light(stage, system, target, None)["so_far"])
    wanted = target.reshape(24, 3, 24, 3).mean(axis=(1, 3))
    off = np.linalg.norm(light - wanted) / np.linalg.norm(wanted)
    assert f"rel_l2 {off:.3g} so far" in said
