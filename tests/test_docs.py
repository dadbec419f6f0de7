"""The pages of docs/ and the README: every Python block runs, and prints what its comments say."""

import re
from contextlib import redirect_stdout
from io import StringIO

import pytest

from tests.cases import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)")


def plain(text):
    """Return the words of a text with single blanks between them."""
    return " ".join(text.split())


def comments(code):
    """Return what stands behind the hash signs of a block."""
    return plain(" ".join(line.partition("#")[2] for line in code.splitlines()))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_blocks_print_what_their_comments_say(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {}
    for code in BLOCK.findall(page.read_text("utf-8")):
        out = StringIO()
        with redirect_stdout(out):
            exec(compile(code, page.name, "exec"), names)
        for line in out.getvalue().splitlines():
            assert plain(line) in comments(code)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in LINK.findall(page.read_text("utf-8")):
        assert target.startswith("https://") or (page.parent / target).exists(), target
