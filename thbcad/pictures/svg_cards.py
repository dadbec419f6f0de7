"""A picture beside a few numbers, as HTML for notebooks."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from thbcad.checks import Floats

LONGEST = 260.0  # pixels: the longer side of a picture
SLIMMEST = 0.25  # of the longer side: the shorter one, at least
STYLE = "display:flex;flex-wrap:wrap;gap:1em;align-items:center;font:13px/1.4 system-ui,sans-serif"


def frame_size(width: float, height: float) -> tuple[float, float]:
    """Return width and height in pixels of a picture of a rectangle; slim ones are drawn wider."""
    longer = max(width, height)
    across, up = (LONGEST * max(side / longer, SLIMMEST) for side in (width, height))
    return across, up


def svg(content: str, width: float, height: float) -> str:
    """Return an SVG picture on white."""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width + 2:g}" height="{height + 2:g}" '
        f'viewBox="-1 -1 {width + 2:g} {height + 2:g}" style="background:#fff;max-width:100%">{content}</svg>'
    )


def line_path(points: Floats) -> str:
    """Return the line through points (n, 2) in pixels as the text of an SVG path."""
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def interval_text(low: float, high: float, unit: str = "") -> str:
    """Return "0.1 to 3 mm", with four digits."""
    return f"{low + 0.0:.4g} to {high + 0.0:.4g} {unit}".rstrip()  # 0, where it is -0


def card(title: str, picture: str, rows: Iterable[tuple[str, object]]) -> str:
    """Return a picture beside a table of names and values as HTML."""
    cells = "".join(
        f'<tr><td style="text-align:left;color:#777">{escape(name)}</td>'
        f'<td style="text-align:left">{escape(str(value))}</td></tr>'
        for name, value in rows
    )
    table = f'<table style="font:inherit">{cells}</table>'
    return f'<div style="{STYLE}">{picture}<div><b>{escape(title)}</b>{table}</div></div>'
