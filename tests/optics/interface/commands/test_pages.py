"""Pages in a real browser: nothing overflows or is missing, the console is empty; a report fits 3 sheets."""

import re
import shutil
from html import unescape

import numpy as np
import pytest

from optics.interface.commands import main
from tests.browser import Browser, browser_path, pdf_pages
from tests.cases import EXAMPLES
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import QUICK
from tests.optics.interface.sweeps.cases import picky, thread_pool

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(browser_path() is None, reason="no Chromium: apt-get install chromium"),
]
A4 = (595.0, 842.0)  # points
FAR = {"target.distance": np.inf, "target.half_width": [15.0, 15.0], "target.kind": "tophat"}
FAILING = {"limits.slope": 1.0, "limits.feature": 50.0, "verify.rel_l2": 1e-3}
NO_PICTURE = "Array.from(document.images).filter(i => !(i.complete && i.naturalWidth > 0)).map(i => i.alt)"
OVERFLOW = "document.documentElement.scrollWidth - innerWidth"


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("browser")) as browser:
        yield browser


def look_at(browser, page, sheets=None):
    """Open a page at two widths and print it."""
    for width in (1440, 800):
        browser.resize(width)
        browser.open(page)
        assert browser.value(OVERFLOW) <= 0, width
        assert browser.value(NO_PICTURE) == []
        assert browser.console == []
    count, papers = pdf_pages(browser.pdf())
    if sheets:
        assert 1 <= count <= sheets
        for paper in papers:
            assert paper == pytest.approx(A4, abs=1)


def designed(folder, changes):
    """Return the report of a quick design, which may fail its checks."""
    problem = write_problem(folder, QUICK | changes)
    code = main(["design", str(problem), "--out", str(folder / "result"), "--quiet"])
    assert code == (4 if "limits.slope" in changes else 0)
    return folder / "result" / "report.html"


def test_the_report_is_whole_in_a_browser(browser, golden):
    look_at(browser, golden.path / "report.html", sheets=3)
    assert browser.value("document.images[0].getBoundingClientRect().top") < 900  # the photograph comes first
    assert browser.value("document.images.length") >= 10


@pytest.mark.parametrize("changes", [FAR, FAILING], ids=["far field", "limits that fail"])
def test_so_are_reports_of_a_far_field_and_of_failures(browser, tmp_path, capsys, changes):
    page = designed(tmp_path, changes)
    look_at(browser, page, sheets=3)
    failures = browser.value("document.querySelectorAll('.banner.bad').length")
    assert failures == ("limits.slope" in changes)


def test_so_is_the_view_by_itself(browser, golden, tmp_path):
    """In the report it is a page of its own, whose console is another one."""
    (view,) = re.findall(r'srcdoc="([^"]*)"', (golden.path / "report.html").read_text("utf-8"))
    page = tmp_path / "view.html"
    page.write_text(unescape(view), "utf-8")
    look_at(browser, page)
    assert browser.value("document.querySelector('canvas').width") > 400


def test_so_are_the_pages_of_tolerances_and_tools(browser, golden, tmp_path, capsys):
    copy = shutil.copytree(golden.path, tmp_path / "copy")
    assert main(["tolerance", str(copy)]) == 0
    look_at(browser, copy / "tolerance.html")
    main(["tool", str(copy), "--nose", "2", "--feed", "0.02"])
    look_at(browser, copy / "tool" / "tool.html")


def test_so_is_the_page_of_a_sweep(browser, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("optics.interface.sweeps.running.worker_pool", thread_pool)
    monkeypatch.setattr("optics.interface.sweeps.running.designed", picky)
    words = ["--vary", "target.distance=200:300:2", "--out", str(tmp_path), "--quiet"]
    main(["sweep", str(EXAMPLES / "tophat_circle.toml"), *words])
    look_at(browser, tmp_path / "sweep.html")
    assert browser.value("document.querySelectorAll('tbody tr').length") == 2


def test_the_browser_tells_of_errors_and_of_missing_pictures(browser, tmp_path):
    """Else the tests above could not fail."""
    page = tmp_path / "bad.html"
    page.write_text(
        '<img src="none.png" alt="gone"><div style="width:3000px">wide</div><script>none()</script>'
    )
    browser.open(page)
    assert browser.console
    assert browser.value(NO_PICTURE) == ["gone"]
    assert browser.value(OVERFLOW) > 1000
