"""The page of a run in a real browser: it is whole, loads itself again, and leads to the report."""

import time

import numpy as np
import pytest

from optics.base.runtime import ProgressEvent
from optics.designing.optimisation import Row
from optics.reporting.live.live_page import LiveState, live_page
from optics.reporting.report import light_pictures
from tests.browser import LIMIT, Browser, browser_path

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(browser_path() is None, reason="no Chromium: apt-get install chromium"),
]
LIGHT = np.linspace(0, 1, 48 * 64).reshape(48, 64)
ROWS = [Row(0, 100, k, 0.0, 1 / (k + 1), 0.0, stage=k // 5) for k in range(20)]
EVENT = ProgressEvent("level 1", 1.0, "289 DOF", 0.5, 9.0)


def page_of(title):
    return live_page(LiveState(title, EVENT, ROWS, ["U0 0.5"], light_pictures(LIGHT, LIGHT**2)))


def wait_until(done):
    end = time.monotonic() + LIMIT
    while not done():
        assert time.monotonic() < end
        time.sleep(0.1)


def test_the_page_of_a_run_loads_itself_again_and_leads_to_the_report(tmp_path):
    page = tmp_path / "live.html"
    (tmp_path / "report.html").write_text("<title>report</title>")
    page.write_text(page_of("first"), "utf-8")
    with Browser(tmp_path / "browser") as browser:
        for width in (1440, 800, 320):
            browser.resize(width)
            browser.open(page)
            assert browser.value("document.documentElement.scrollWidth - innerWidth") <= 0, width
            assert browser.value("Array.from(document.images).every(i => i.naturalWidth > 0)")
            assert browser.console == []
        page.write_text(page_of("second"), "utf-8")
        wait_until(lambda: browser.value("document.title") == "second")
        page.write_text(live_page(LiveState("third", EVENT, done=True)), "utf-8")
        wait_until(lambda: browser.value("document.title") == "report")
