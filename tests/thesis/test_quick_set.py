"""The quick set of all studies, through the command line: every claim is judged, every picture is there."""

import json
import re

import pytest

from tests.thesis.cases import copied_checkout, studies

PICTURE = re.compile(r"!\[[^\]]*\]\(([^)]+)\)")
VERDICT = re.compile(r"\*\*(holds|fails|cannot be judged)\*\*$")


@pytest.fixture(scope="module")
def quick_set(tmp_path_factory):
    """Return the rows of the whole quick set, and the folder of its pages."""
    checkout = copied_checkout(tmp_path_factory.mktemp("checkout"))
    stdout, stderr = studies(checkout, "--quick", "--json").communicate()
    assert "Traceback" not in stderr
    return json.loads(stdout), checkout / "build" / "thesis" / "quick" / "pages"


@pytest.mark.slow
def test_every_study_ends_and_judges_all_its_claims(quick_set):
    rows, folder = quick_set
    assert {row["name"] for row in rows if not row["ok"]} <= {"all"}  # a busy machine may take longer
    numbers = [int(n) for row in rows for n in re.findall(r"^study (\d+):", row["name"])]
    sections = [
        int(n)
        for page in folder.glob("chapter*.md")
        for n in re.findall(r"^## (\d+)\.", page.read_text(), re.M)
    ]
    assert sorted(sections) == sorted(numbers)
    assert len(numbers) >= 3
    judged = 0
    for page in folder.glob("chapter*.md"):
        for table in re.findall(r"\| verdict \|\n\|[- |]+\|\n((?:\|.*\n)+)", page.read_text()):
            lines = [line.rstrip(" |") for line in table.splitlines()]
            assert [line for line in lines if not VERDICT.search(line)] == []
            judged += len(lines)
    assert judged == sum(row["value"] for row in rows if row["name"].startswith("  claims"))


@pytest.mark.slow
def test_every_picture_of_the_quick_set_is_on_a_page_and_small(quick_set):
    _, folder = quick_set
    named = [name for page in folder.glob("*.md") for name in PICTURE.findall(page.read_text())]
    assert sorted(named) == sorted(path.name for path in folder.glob("*.png"))
    assert [path.name for path in folder.glob("*.png") if path.stat().st_size > 250_000] == []
