"""Pages of sections: each with sentences, a table and pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from optics.reporting.report.html import figures_html, list_html, page_head


@dataclass(frozen=True)
class PageSection:
    """A part of a page.

    sentences : above the table, as a list.  head, rows : of the table; none without rows.
    pictures : (caption, PNG bytes).
    """

    title: str
    sentences: Sequence[str] = ()
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    pictures: Sequence[tuple[str, bytes]] = ()


def section_page(title: str, introduction: str, sections: Iterable[PageSection]) -> str:
    """Return a page that holds everything in itself.  introduction : a sentence or two, text."""
    body = "".join(_section(section) for section in sections)
    return f"{page_head(escape(title))}<p>{escape(introduction)}</p>{body}</html>\n"


def _section(section: PageSection) -> str:
    table = _table(section.head, section.rows) if section.rows else ""
    pictures = f'<div class="figures">{figures_html(section.pictures)}</div>' if section.pictures else ""
    return f"<h2>{escape(section.title)}</h2>{list_html(section.sentences, 'notes')}{table}{pictures}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of texts."""
    lines = ["<tr>" + "".join(f'<th scope="col">{escape(name)}</th>' for name in head) + "</tr>"]
    lines += ["<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows]
    return f'<div class="table"><table>{"".join(lines)}</table></div>'
