"""Which numbers of which pages are quoted from stored rows: docs/data/quotes.toml.

Each table names a page, the end of a text on it, and a row.  The text is on the page once, and ends with the
number or with the number and its unit.  In memory a page carries a mark after each of them, as in
`quoted_numbers`.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

from benchmarks.rows.quoted_numbers import MARK
from optics.base.runtime import UserError

FILE = Path("docs", "data", "quotes.toml")
HEAD = """\
# Numbers that pages quote: the page, a text on it that ends with the number (and its unit), and the stored
# row, `benchmark: row`. `thbcad bench --markdown` refreshes the numbers in the pages and here.
"""


def marked_pages(root: Path) -> dict[Path, str]:
    """Return the pages of a checkout that quote stored rows, with their marks, by path.

    Raises UserError : a page lacks, or a text that is not on its page exactly once.
    """
    path = root / FILE
    quotes = tomllib.loads(path.read_text("utf-8")).get("quote", []) if path.exists() else []
    pages: dict[Path, str] = {}
    places: dict[Path, list[tuple[int, str]]] = {}
    for quote in quotes:
        page, text = root / quote["page"], quote["text"]
        if page not in pages:
            if not page.exists():
                raise UserError(f"{FILE}: there is no page {quote['page']}")
            pages[page] = page.read_text("utf-8")
        if (count := _count(pages[page], text)) != 1:
            raise UserError(f"{FILE}: {quote['page']} has {count} times the text {text!r}, wanted once")
        places.setdefault(page, []).append((pages[page].index(text) + len(text), quote["row"]))
    return {page: _with_marks(text, places[page]) for page, text in pages.items()}


def without_marks(page: str) -> str:
    """Return a page as it is written, without its marks."""
    return MARK.sub(lambda found: f"{found['number'] or ''}{found['unit'] or ''}", page)


def quotes_text(pages: Mapping[str, str]) -> str:
    """Return docs/data/quotes.toml.  pages : with their marks, by their path from the root."""
    tables = [HEAD]
    for name, page in sorted(pages.items()):
        plain = without_marks(page)
        tables += [
            f"[[quote]]\npage = {_toml(name)}\ntext = {_toml(text)}\nrow = {_toml(row)}\n"
            for text, row in _quotes(page, plain)
        ]
    return "\n".join(tables)


def _with_marks(page: str, places: list[tuple[int, str]]) -> str:
    for end, row in sorted(places, reverse=True):
        page = f"{page[:end]}<!-- {row} -->{page[end:]}"
    return page


def _quotes(page: str, plain: str) -> list[tuple[str, str]]:
    """Return (text, row) of the marks of a page: numbers with the words before them that make them unique."""
    found, end = [], 0
    for mark in MARK.finditer(page):
        shown = f"{mark['number'] or ''}{mark['unit'] or ''}"
        end = len(without_marks(page[: mark.end()]))
        start = _word_before(plain, end - len(shown))
        while start and _count(plain, plain[start:end]) > 1:
            start = _word_before(plain, start)
        found.append((plain[start:end], f"{mark['name']}: {mark['row']}"))
    return found


def _count(page: str, text: str) -> int:
    """Return how often a text is on a page, also where it overlaps itself."""
    return len(re.findall(f"(?={re.escape(text)})", page))


def _word_before(text: str, start: int) -> int:
    """Return where the word before a place begins, or its line."""
    before = text[: max(start - 1, 0)]
    return max(before.rfind(" "), before.rfind("\n")) + 1


def _toml(text: str) -> str:
    """Return a text as TOML writes it: as JSON does."""
    return json.dumps(text, ensure_ascii=False)
