"""`thbcad design --live`: the page of a run, and that the design does not change by it."""

import json
import sys
import time

import pytest

from optics.exchange.results import LIVE
from optics.interface.commands import main
from optics.interface.commands.design_command import show_in_browser
from tests.optics.cases import write_problem
from tests.optics.interface.commands.cases import QUICK, assert_whole, command, content, raising


@pytest.fixture(scope="module")
def watched(golden, tmp_path_factory):
    """The golden run again with --live: its folder, what it said, and the pages that were seen meanwhile."""
    out, pages = tmp_path_factory.mktemp("live") / "out", []
    process = command("design", golden.problem, "--out", out, "--live")
    while process.poll() is None:
        if (out / LIVE).exists():
            pages.append((out / LIVE).read_text("utf-8"))
        time.sleep(0.02)
    return out, process.communicate()[1], pages


@pytest.mark.slow  # a whole program
def test_the_bytes_of_a_result_are_the_same_with_and_without_a_live_page(watched, golden):
    out, _, _ = watched
    assert_whole(out)
    found, plain = (
        {p.relative_to(folder).as_posix(): content(p) for p in folder.rglob("*.*")}
        for folder in (out, golden.path)
    )
    assert found.pop(LIVE)
    assert found == plain
    assert LIVE not in json.loads((out / "result.json").read_text())["sha256"]


@pytest.mark.slow
def test_pages_are_whole_at_any_time_show_light_and_end_at_the_report(watched):
    out, said, pages = watched
    assert f"thbcad: note: watch it in a browser: {(out / LIVE).resolve().as_uri()}\n" in said
    assert all(
        page.endswith("</html>\n<!-- a live page of thbcad: the next run in this folder replaces it -->\n")
        for page in pages
    )
    assert any("rel_l2" in page and page.count("data:image/png") == 3 for page in pages)
    assert 'content="0;url=report.html"' in (out / LIVE).read_text("utf-8")


def test_a_run_that_is_stopped_says_so_on_its_page(monkeypatch, no_helpers, tmp_path, capsys):
    monkeypatch.setattr("optics.interface.api.designed", raising(KeyboardInterrupt))
    problem = write_problem(tmp_path, QUICK)
    assert main(["design", str(problem), "--out", str(tmp_path / "out"), "--live"]) == 130
    page = (tmp_path / "out" / LIVE).read_text("utf-8")
    assert "nothing was kept, since no level had begun" in page
    assert "refresh" not in page


@pytest.mark.parametrize(
    ("terminal", "display", "opened"), [(True, ":0", 1), (False, ":0", 0), (True, "", 0)], ids=str
)
def test_a_browser_opens_where_a_person_sits_before_a_screen(
    monkeypatch, capsys, tmp_path, terminal, display, opened
):
    shown = []
    monkeypatch.setattr("webbrowser.open", shown.append)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    show_in_browser(tmp_path / LIVE)
    assert shown == opened * [(tmp_path / LIVE).as_uri()]
    assert (tmp_path / LIVE).as_uri() in capsys.readouterr().err
