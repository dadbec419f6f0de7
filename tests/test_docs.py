"""The pages of docs/ and the README: blocks run, and numbers are the measured ones."""

import os
import re
import subprocess
import sys
from collections import defaultdict

import pytest

from benchmarks.rows.pages import benchmark_page, loaded, own_pages
from benchmarks.rows.quoted_numbers import marked_numbers, quoted_rows, without_marked_numbers
from benchmarks.rows.quotes import marked_pages
from benchmarks.rows.stored_rows import read_rows
from optics.scene.problem import load_problem
from tests.cases import EXAMPLES, ROOT
from tests.page_blocks import blocks, of_cadquery, unannounced

PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
STUDIES = ROOT / "docs" / "thesis"
BY_HAND = {STUDIES / "chapter3.md", STUDIES / "corrections.md"}
WRITTEN = [ROOT / "docs" / "benchmarks.md", *({*STUDIES.glob("*.md")} - BY_HAND)]  # by a program
QUOTING = [
    page for page in PAGES if page.name not in ("CONTRIBUTING.md", "CHANGELOG.md") and page not in WRITTEN
]
STORED = read_rows(ROOT / "docs" / "data")
MARKED = {page: page.read_text("utf-8") for page in QUOTING} | marked_pages(ROOT)
KERNEL = ("README", "bsplines", "thb", "nurbs", "fitting", "sags", "conversion", "bounds")  # without optics
TOML = re.compile(r"^```toml\n(.*?)^```", re.DOTALL | re.MULTILINE)
CODE = re.compile(r"^```.*?^```|`[^`]*`", re.DOTALL | re.MULTILINE)
TIME = re.compile(
    r"(?<![\w.^])\d[\d.]*(?:e-?\d+)? ?(?:ns|us|ms|s|min|seconds?|minutes?|hours?|rays/s)\b(?!\^)"
)
LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)")
LINKED = re.compile(r"!?\[[^]]*\]\([^)]*\)")
DIGITS = re.compile(r"\d[\d.]*")
SHARE = re.compile(r"(?<![\w.,])(\d+(?:\.\d+)?) ?%")
SECOND_TIMES = {"profile: pearl", "profile: pearl: to the verified STEP"}  # of what `overview` times
NO_MEASUREMENTS = {
    ("others.md", "14.8"),  # published by others
    ("possible_light.md", "92.3"),  # the words of a message
    ("results.md", "20.8"),  # the words of a verdict
    ("results.md", "0.01"),  # a threshold of the program
}


@pytest.mark.every(3)
@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=lambda page: page.name)
def test_blocks_print_what_their_comments_say(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(EXAMPLES)
    names = {}
    for block in blocks(page):
        if not of_cadquery(block):
            assert unannounced(block, names) == []


@pytest.mark.slow
def test_blocks_of_the_kernel_pass_strict_type_checks(tmp_path):
    """All but the types of functions that the blocks define themselves; thbcad as it is when installed."""
    for name in KERNEL:
        code = "\n".join(blocks(ROOT / "docs" / f"{name}.md"))
        (tmp_path / f"{name}.py").write_text(code, "utf-8")
    options = ["--strict", "--allow-untyped-defs", "--allow-untyped-calls", "--follow-imports=silent"]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, "--config-file=", *(f"{name}.py" for name in KERNEL)],
        cwd=tmp_path,
        env={**os.environ, "MYPYPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_quoted_numbers_are_the_stored_ones():
    """`thbcad bench --markdown` refreshes them."""
    quoted = [(page.name, q) for page, text in MARKED.items() for q in marked_numbers(text, STORED)]
    assert len(quoted) > 100
    assert [(page, q) for page, q in quoted if q.text != q.wanted] == []


def test_no_time_is_quoted_without_its_mark():
    """Times are measured, but for limits and times of others, in the last column of tables."""
    texts = {page.name: without_marked_numbers(CODE.sub("", text)) for page, text in MARKED.items()}
    lines = [
        (page, line.rpartition("|")[0].rpartition("|")[0] if line.startswith("|") else line)
        for page, text in texts.items()
        for line in text.splitlines()
    ]
    assert [(page, line) for page, line in lines if TIME.search(line)] == []


def test_pages_quote_each_measured_fact_from_one_row():
    """Several benchmarks design the pearl: pages gave 6.3, 6.6 and 7.3 s for it."""
    quoted = {f"{name}: {row}" for text in MARKED.values() for name, row in quoted_rows(text)}
    elsewhere = loaded(ROOT, ROOT / "benchmarks" / "gallery" / "gallery_page.py").ELSEWHERE
    repeated = {f"gallery: {lens}: {row}" for lens, rows in elsewhere.items() for row in rows}
    assert quoted & (repeated | SECOND_TIMES) == set()
    assert {mark for rows in elsewhere.values() for mark in rows.values()} <= quoted
    homes = defaultdict(set)
    for mark in quoted:
        homes[mark.partition(": ")[2]].add(mark)
    assert [marks for marks in homes.values() if len(marks) > 1] == []


def test_no_share_in_three_digits_is_quoted_without_its_mark():
    """In text, code and output alike: `0.0806 %` stood in code, where the stored row said 0.0827."""
    shares = {
        (page.name, found[1])
        for page, text in MARKED.items()
        for found in SHARE.finditer(without_marked_numbers(text))
        if len(found[1].replace(".", "")) > 2 and found[1] != "100"
    }
    assert shares - NO_MEASUREMENTS == set()


def test_every_stored_row_says_whether_it_was_measured_or_extrapolated():
    """What was extrapolated names its law."""
    rows = [(name, full, row) for name in STORED for full, row in STORED[name].named()]
    assert [row for *row, r in rows if r["basis"] not in ("measured", "extrapolated")] == []
    assert [row for *row, r in rows if r["basis"] == "extrapolated" and not r["reference"]] == []


def test_rows_that_compare_methods_name_quantity_and_estimator():
    lenses = ("base: ", "pearl: ", "extended: ")
    rows = [*STORED["pixels"].rows, *(r for r in STORED["error"].rows if r["name"].startswith(lenses))]
    # gradients held against differences have no other method beside them
    compared = [row for row in rows if "worst of 20 differences" not in row["name"]]
    assert [row["name"] for row in compared if not {"quantity", "estimator"} <= set(row)] == []


def test_no_ratio_sets_box_pixels_against_a_window():
    """The particle tracer is compared in each of the two measures with our light in the same one."""
    rows = {f"{name}: {full}": row for name in STORED for full, row in STORED[name].named()}
    ratios = {full: row for full, row in rows.items() if "ptracer to" in row["name"]}
    assert {row["quantity"] for row in ratios.values()} == {
        "irradiance, box pixels",
        "irradiance, Gaussian window",
    }
    for full, row in ratios.items():
        assert ("Gaussian window" in full) == ("Gaussian window" in row["quantity"]), full
        assert row["basis"] == "extrapolated"
        assert row["error"] > 0


def test_the_page_of_benchmarks_is_that_of_the_stored_rows():
    assert (ROOT / "docs" / "benchmarks.md").read_text("utf-8") == benchmark_page(ROOT)


def test_the_pages_of_the_studies_are_those_of_the_stored_runs():
    pages = own_pages(ROOT, ROOT / "benchmarks" / "thesis" / "thesis.py")
    assert set(pages) == set(STUDIES.glob("*.md")) - BY_HAND
    assert [path.name for path, text in pages.items() if path.read_text("utf-8") != text] == []


def test_every_picture_of_the_studies_is_on_a_page():
    """That every picture of a page exists is tested with the links."""
    named = {target for page in STUDIES.glob("*.md") for target in LINK.findall(page.read_text("utf-8"))}
    pictures = {path.name for path in STUDIES.glob("*.png")}
    assert pictures != set()
    assert pictures <= named


def table_rows(page):
    """Return the rows of all tables of a page as lists of cells, without the rows of dashes."""
    rows = [re.split(r"(?<!\\)\|", line)[1:-1] for line in page.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row] for row in rows if set("".join(row)) - set("-: ")]


def test_tables_of_the_readme_hold_marked_numbers_and_published_ones():
    """What is not marked was published by others, and is in the reference of a marked row of the line."""
    rows = table_rows(MARKED[ROOT / "README.md"])
    assert len(rows) > 6
    for row in rows:
        text = LINKED.sub("", " ".join(row))
        references = " ".join(quoted.row["reference"] for quoted in marked_numbers(text, STORED))
        by_hand = set(DIGITS.findall(without_marked_numbers(text)))
        assert by_hand <= set(DIGITS.findall(references)), row


@pytest.mark.parametrize(
    ("page", "lines"), [("README.md", 8), ("docs/README.md", 9), ("docs/first_lens.md", None)]
)
def test_the_problem_of_a_first_page_is_that_of_the_pearl(page, lines, tmp_path):
    (text,) = TOML.findall((ROOT / page).read_text("utf-8"))
    assert lines in (len(text.splitlines()), None)
    (tmp_path / "my.toml").write_text(text.replace("pearl.png", str(EXAMPLES / "pearl.png")), "utf-8")
    assert load_problem(tmp_path / "my.toml") == load_problem(EXAMPLES / "pearl.toml")


def test_the_pages_are_short():
    """Tables of stored rows, which a program writes, do not count."""
    written = ROOT / "docs" / "benchmarks.md"
    texts = [page.read_text("utf-8") for page in (ROOT / "docs").rglob("*.md") if page != written]
    assert sum(len(text.split()) for text in texts) <= 61_125


def test_the_readme_is_short_and_so_are_the_cells_of_its_tables():
    page = (ROOT / "README.md").read_text("utf-8")
    assert len(page.split()) <= 750
    cells = [LINKED.sub("link", cell) for row in table_rows(page) for cell in row]
    assert [cell for cell in cells if len(cell.split()) > 12] == []


def test_no_page_hides_anything_in_comments():
    assert [page.name for page in PAGES if "<!--" in page.read_text("utf-8")] == []


def test_every_room_stands_on_the_page_of_the_architecture():
    """Those of optics in its plan too."""
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    plan = set(re.findall(r"\w+", page.partition("```text")[2].partition("```")[0]))
    geometry, light = (
        [path.relative_to(ROOT / package).parts[:-1] for path in (ROOT / package).rglob("__init__.py")]
        for package in ("thbcad", "optics")
    )
    assert [room for room in geometry if room and f"`{'.'.join(room)}`" not in page] == []
    assert [room for room in light if room and f"`{room[-1]}`" not in page] == []
    assert [room for room in light if room and room[-1] not in plan] == []
