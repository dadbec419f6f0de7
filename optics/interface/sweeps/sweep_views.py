"""What shows a sweep: the pictures of all variants side by side, a plot of every metric against what was
varied, and a page with a table that sorts, which loads nothing from elsewhere.
"""

from __future__ import annotations

import base64
import io
import math
import re
from collections import defaultdict
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any, cast

from optics.interface.sweeps.sweep_rows import DONE, Sweep, SweepRow, cell, columns

MOST = 400  # pictures: 20 x 20 still fit on a screen
TILE, LINE, GAP = 96, 11, 6  # pixels: of a picture, of a line of text below it, between them
MOST_LETTERS = 18  # of a line: a tile is no wider
Line = list[tuple[Any, float]]
MOST_LINES = 8  # of a plot: more have no place in its legend
ROUNDING, TINY = 1e-9, 1e-12  # differences of metrics that say nothing: relative, and of parts of the flux
MOST_WORDS = 20  # values of a key without numbers: labels below the axis
PAGE = Path(__file__).with_name("sweep_page.html")
MOST_PICTURES = 1000  # in the table: about 5 kB each
WORDY = ("sentence", "verdict", "notes")  # columns of sentences
MARK = re.compile("TITLE|SUMMARY|HEAD|BODY|PLOTS")


def contact_sheet(sweep: Sweep) -> bytes | None:
    """Return the pictures of the first variants that have one, with their values below, as PNG."""
    from PIL import Image, ImageDraw

    rows = [row for row in sweep.rows if row.picture][:MOST]
    if not rows:
        return None
    names = [key.rpartition(".")[2] for key in sweep.keys]
    across = math.ceil(math.sqrt(len(rows)))
    wide, high = TILE + GAP, TILE + GAP + LINE * len(names)
    sheet = Image.new("L", (across * wide + GAP, -(-len(rows) // across) * high + GAP), 255)
    draw = ImageDraw.Draw(sheet)
    for k, row in enumerate(rows):
        x, y = GAP + k % across * wide, GAP + k // across * high
        with Image.open(io.BytesIO(row.picture)) as picture:
            scale = TILE / max(picture.size)
            size = (max(1, round(picture.width * scale)), max(1, round(picture.height * scale)))
            sheet.paste(picture.resize(size, Image.Resampling.NEAREST), (x, y))
        for n, text in enumerate(_texts(names, row)):
            draw.text((x, y + TILE + n * LINE), text, fill=0, font_size=LINE - 2)
    buffer = io.BytesIO()
    sheet.save(buffer, "png")
    return buffer.getvalue()


def _texts(names: list[str], row: SweepRow) -> list[str]:
    """Return a line for every varied key: the value, numbers with six digits, and of its name what fits."""
    values = [f"{v:.6g}" if isinstance(v, float) else str(cell(v))[:MOST_LETTERS] for v in row.values]
    return [f"{name[: max(0, MOST_LETTERS - 1 - len(v))]} {v}".strip() for name, v in zip(names, values)]


def metric_plots(sweep: Sweep) -> dict[str, bytes]:
    """Return {metric: PNG} for every metric that is a number and is not the same everywhere.

    The key that has most numbers runs along the axis, the others' combinations are lines.
    """
    along, plots = _axis(sweep), {}
    for metric in [*sweep.metrics, "seconds"]:
        lines = defaultdict[str, "Line"](list)
        for row in sweep.rows:
            value = row.seconds if metric == "seconds" else row.metrics.get(metric)
            if row.status == DONE and _is_number(value):
                others = [f"{key} {cell(at)}" for key, at in zip(sweep.keys, row.values)]
                name = ", ".join(others[:along] + others[along + 1 :])
                lines[name].append((row.values[along], cast("float", value)))
        numbers = [value for line in lines.values() for _, value in line]
        if numbers and max(numbers) - min(numbers) > max(ROUNDING * max(map(abs, numbers)), TINY):
            plots[metric] = _plot(sweep.keys[along], metric, lines)
    return plots


def plot_name(metric: str) -> str:
    """Return the name of the file of a plot, within the folder of the sweep."""
    return f"figures/{re.sub('[^A-Za-z0-9_]+', '_', metric)}.png"


def _axis(sweep: Sweep) -> int:
    """Return which key runs along the axis."""

    def numbers(at: int) -> int:
        values = {row.values[at] for row in sweep.rows if _is_number(row.values[at])}
        return len(values)

    return max(range(len(sweep.keys)), key=numbers)


def _plot(key: str, metric: str, lines: dict[str, Line]) -> bytes:
    from optics.reporting.figures import new_figure, png_bytes  # matplotlib

    figure, axes = new_figure()
    shown = list(lines.items())[:MOST_LINES]
    named = not all(_is_number(x) for _, line in shown for x, _ in line)
    for label, line in shown:
        points = [(str(cell(x)), y) for x, y in line] if named else sorted(line)
        axes.plot(*zip(*points), "o-" if len(points) < 40 else "-", ms=4, lw=1, label=label)
    axes.set_xlabel(key)
    axes.set_ylabel(metric)
    axes.grid(alpha=0.3)
    axes.ticklabel_format(axis="y", useOffset=False)
    if named and len(shown[0][1]) > MOST_WORDS:
        axes.set_xticks([])
    if len(shown) > 1:
        axes.legend(fontsize=6, title="" if len(lines) == len(shown) else f"{len(shown)} of {len(lines)}")
    return png_bytes(figure)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


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
