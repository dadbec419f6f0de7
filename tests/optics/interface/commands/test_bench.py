"""`thbcad bench`: stored rows, the page of all of them, and what is refused."""

import json
import sys
import tomllib
from shutil import copytree

import pytest

from benchmarks.rows.pages import benchmark_tables
from benchmarks.rows.stored_rows import machine_facts
from optics.interface.commands import bench_command, main
from tests.cases import ROOT
from tests.optics.interface.commands.cases import data_of, printed, refused

BENCHMARK = '''"""Two
lines | of one sentence.

More.
"""

from benchmarks.rows.row import Row


def rows():
    first = [Row("time", 12.3456, "s", "peer 3 s", 15), Row("   of this", 2489)]
    light = {"quantity": "light", "estimator": "rays", "error": 0.0123, "extrapolated": True}
    return [*first, Row("worst", float("inf"), "", "", 1), Row("ratio", 3.0, "", "by a law", **light)]
'''

PARTS = '''"""Can be run in part, and has own pages."""

from pathlib import Path

from benchmarks.rows.row import Row

PAGES = Path(__file__).parents[1] / "docs" / "own"


def rows(quick=False, only=None, resume=False):
    return [Row("quick", quick), Row("only", only or 0), Row("resume", resume)]


def publish():
    PAGES.mkdir()
    (PAGES / "numbers.txt").write_text("42")


def pages():
    return {PAGES / "page.md": "The number is " + (PAGES / "numbers.txt").read_text()}
'''


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """Yield a checkout with one benchmark, and make the command work there."""
    for folder in ("benchmarks", "docs"):
        (tmp_path / folder).mkdir()
    (tmp_path / "benchmarks" / "__init__.py").touch()
    copytree(ROOT / "benchmarks" / "rows", tmp_path / "benchmarks" / "rows")
    (tmp_path / "benchmarks" / "tiny.py").write_text(BENCHMARK)
    (tmp_path / "benchmarks" / "no_rows.py").write_text("ROWS = 1\n")
    (tmp_path / "README.md").write_text("It took 9.9 s.\n")
    (tmp_path / "docs" / "page.md").write_text("Of 1 000 rows 3 are old.\n")
    (tmp_path / "docs" / "data").mkdir()
    quotes = ("README.md", "9.9 s", "time"), ("docs/page.md", "1 000", "time > of this")
    tables = (f'[[quote]]\npage="{p}"\ntext="{text}"\nrow="tiny: {row}"\n' for p, text, row in quotes)
    (tmp_path / "docs" / "data" / "quotes.toml").write_text("".join(tables))
    monkeypatch.setattr(bench_command, "checkout", lambda: tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    others = {name: m for name, m in sys.modules.items() if name.split(".")[0] == "benchmarks"}
    for name in others:
        del sys.modules[name]
    yield tmp_path
    for name in [name for name in sys.modules if name.split(".")[0] == "benchmarks"]:
        del sys.modules[name]
    sys.modules.update(others)


@pytest.fixture
def parts(checkout):
    """A checkout with a second benchmark, which can be run in part and writes its own pages."""
    (checkout / "benchmarks" / "parts.py").write_text(PARTS)
    return checkout


def test_rows_are_stored_as_they_are_printed(checkout, capsys):
    rows = data_of(capsys, "bench", "tiny", "--store", code=1)  # a limit is missed
    stored = json.loads((checkout / "docs" / "data" / "tiny.json").read_text())
    assert stored["rows"] == rows
    assert stored["rows"][0] == {
        "name": "time",
        "value": 12.3456,
        "unit": "s",
        "reference": "peer 3 s",
        "limit": "<= 15",
        "ok": True,
        "basis": "measured",
    }
    light = {"basis": "extrapolated", "quantity": "light", "estimator": "rays", "error": 0.0123}
    assert stored["rows"][-1].items() >= light.items()
    assert stored["machine"] == machine_facts()
    assert len(stored["date"]) == len("2026-11-20")


def test_nothing_is_stored_unasked(checkout):
    main(["bench", "tiny"])
    assert not [*(checkout / "docs" / "data").glob("*.json")]


def test_the_table_of_a_benchmark_says_what_was_extrapolated(checkout, capsys):
    main(["bench", "tiny"])
    first, *_, last = capsys.readouterr().out.splitlines()[2:]
    assert first.split()[-4:] == ["measured", "peer", "3", "s"]
    assert last.endswith("extrapolated light; rays; error 1.2e-02; by a law")


def test_stored_rows_become_a_page_and_refresh_the_quoted_numbers(checkout, capsys):
    main(["bench", "tiny", "--store"])
    assert "wrote docs/benchmarks.md" in printed(capsys, "bench", "--markdown")
    page = (checkout / "docs" / "benchmarks.md").read_text().splitlines()
    assert "## tiny" in page
    assert "Two lines | of one sentence." in page
    assert "| row | value | unit | limit | ok | reference |" in page
    assert "| time | 12.35 | s | &lt;= 15 |  | peer 3 s |" in page
    assert "| time > of this | 2 489 |  |  |  |  |" in page
    assert "| worst | - |  | &lt;= 1 | **no** |  |" in page
    table = benchmark_tables(checkout)["tiny"].splitlines()
    assert "| row | value | unit | limit | ok | basis | quantity | estimator | error | reference |" in table
    assert "| time | 12.35 | s | &lt;= 15 |  | measured |  |  |  | peer 3 s |" in table
    assert "| &nbsp;&nbsp;of this | 2 489 |  |  |  | measured |  |  |  |  |" in table
    assert "| worst | - |  | &lt;= 1 | **no** | measured |  |  |  |  |" in table
    assert "| ratio | 3 |  |  |  | extrapolated | light | rays | 1.2e-02 | by a law |" in table
    assert (checkout / "README.md").read_text() == "It took 12.3 s.\n"
    quoted = (checkout / "docs" / "page.md").read_text()
    assert quoted == "Of 2 489 rows 3 are old.\n"
    kept = tomllib.loads((checkout / "docs" / "data" / "quotes.toml").read_text())["quote"]
    assert [quote["text"] for quote in kept] == ["took 12.3 s", "Of 2 489"]
    assert "every page is up to date" in printed(capsys, "bench", "--markdown")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ([], "bench needs a name; this installation has: tiny"),
        (["no_rows"], "there is no benchmark 'no_rows'; this installation has: tiny"),
        (["--store"], "bench needs a name"),
        (["tiny", "--markdown"], "--markdown runs no benchmark"),
        (["--store", "--markdown"], "--markdown runs no benchmark"),
        (["--markdown"], "there are no stored rows"),
    ],
)
def test_bad_use_is_one_sentence(checkout, capsys, arguments, reason):
    assert reason in refused(capsys, "bench", *arguments)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["tiny", "--quick"], "bench tiny has no parts: leave out --quick"),
        (["tiny", "--only", "4", "--resume"], "bench tiny has no parts: leave out --only, --resume"),
        (["parts", "--quick", "--store"], "--store keeps a whole run: leave out --quick and --only"),
        (["tiny", "--only", "0"], "bench tiny has no parts: leave out --only"),
        (["parts", "--only", "4", "--store"], "--store keeps a whole run: leave out --quick and --only"),
    ],
)
def test_parts_are_for_benchmarks_that_have_them_and_never_stored(parts, capsys, arguments, reason):
    assert refused(capsys, "bench", *arguments) == f"thbcad: {reason}"
    assert not [*(parts / "docs" / "data").glob("*.json")]


def test_a_benchmark_gets_the_parts_that_are_asked_for(parts, capsys):
    for words, values in ((("--quick", "--only", "4", "--resume"), [True, 4, True]), ((), [False, 0, False])):
        assert [row["value"] for row in data_of(capsys, "bench", "parts", *words)] == values


def test_own_pages_are_published_when_rows_are_stored_and_written_from_what_was_published(parts, capsys):
    assert main(["bench", "parts", "--resume"]) == 0
    assert not (parts / "docs" / "own").exists()
    assert main(["bench", "parts", "--store", "--resume"]) == 0
    assert (parts / "docs" / "own" / "numbers.txt").exists()
    main(["bench", "tiny", "--store"])  # the pages of the checkout quote it
    capsys.readouterr()
    assert "wrote docs/own/page.md" in printed(capsys, "bench", "--markdown")
    assert (parts / "docs" / "own" / "page.md").read_text() == "The number is 42"


@pytest.mark.parametrize("text", ["[]", "no json", '{"date": "", "machine": {}, "rows": [{"name": "a"}]}'])
def test_a_file_that_holds_no_rows_is_refused(checkout, capsys, text):
    (checkout / "docs" / "data").mkdir(exist_ok=True)
    (checkout / "docs" / "data" / "tiny.json").write_text(text)
    assert "holds no rows of a benchmark" in refused(capsys, "bench", "--markdown")


def test_rows_of_a_benchmark_that_is_gone_are_refused(checkout, capsys):
    main(["bench", "tiny", "--store"])
    (checkout / "benchmarks" / "tiny.py").unlink()
    capsys.readouterr()
    assert "docs/data/tiny.json belongs to no benchmark" in refused(capsys, "bench", "--markdown")


@pytest.mark.parametrize(("old", "new"), [("of this", "gone"), ("1 000", "1 001")])
def test_no_page_changes_where_a_quote_leads_nowhere(old, new, checkout):
    main(["bench", "tiny", "--store"])
    quotes = checkout / "docs" / "data" / "quotes.toml"
    quotes.write_text(quotes.read_text().replace(old, new))
    assert main(["bench", "--markdown"]) == 2
    assert (checkout / "README.md").read_text().startswith("It took 9.9 s")
    assert not (checkout / "docs" / "benchmarks.md").exists()
