"""The page of a sweep: a table that sorts, with pictures, and the plots; it loads nothing from elsewhere."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from optics.interface.sweeps.sweep_rows import Sweep, SweepRow, cell, columns

PAGE = Path(__file__).with_suffix(".html")
MOST_PICTURES = 1000  # in the table: about 5 kB each
WORDY = ("sentence", "verdict", "notes")  # columns of sentences
MARK = re.compile("TITLE|SUMMARY|HEAD|BODY|PLOTS")


def sweep_page(sweep: Sweep, title: str, plots: Mapping[str, bytes]) -> str:
    """Return the page as HTML.  plots : PNG by metric."""
    counts = sweep.counts()
    pictured = sum(bool(row.picture) for row in sweep.rows) <= MOST_PICTURES
    names = columns(sweep)
    parts = {
        "TITLE": escape(title),
        "SUMMARY": f"{len(sweep.rows)} variants: "
        + ", ".join(f"{n} {word}" for word, n in {**counts, **sweep.grades()}.items() if n),
        "HEAD": ('<th scope="col">light</th>' if pictured else "")
        + "".join(f'<th scope="col"><button type="button">{escape(name)}</button></th>' for name in names),
        "BODY": "".join(
            f'<tr class="{_colour(row)}">{_picture(row.picture) if pictured else ""}'
            f"{''.join(_cell(line[name], name) for name in names)}</tr>\n"
            for row, line in zip(sweep.rows, sweep.table())
        ),
        "PLOTS": "".join(
            f'<img alt="{escape(metric)}" src="{_source(png)}">' for metric, png in plots.items()
        ),
    }
    return MARK.sub(lambda found: parts[found[0]], PAGE.read_text("utf-8"))


def _colour(row: SweepRow) -> str:
    """Return the class of a row: its grade where it has one, else its status."""
    return str(row.metrics.get("grade", row.status)).replace(" ", "-")


def _picture(png: bytes) -> str:
    return f'<td><img alt="light on the target" src="{_source(png)}"></td>' if png else "<td></td>"


def _cell(value: Any, name: str) -> str:
    """Return a cell; a number is shown with six digits, and sorts with all of them."""
    if isinstance(value, float):
        return f'<td class="n" data-v="{value!r}">{value:.6g}</td>'
    text = escape(str(cell(value)))
    return f'<td class="{"n" if isinstance(value, int) else "s" if name in WORDY else "t"}">{text}</td>'


def _source(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
