"""A drawing sheet as PDF, at its scale; its texts are Helvetica, which every reader of PDF has."""

import io
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from thbcad.drawings import CAPITALS, DASHES, WIDTHS, Sheet, strokes_of_views

POINTS = 72 / 25.4  # per mm


def sheet_pdf(sheet: Sheet) -> bytes:
    """Return a sheet as a PDF file without a date; characters that Windows-1252 lacks become "?"."""
    buffer, (width, height) = io.BytesIO(), sheet.size
    settings: dict[Any, Any] = {
        "pdf.use14corefonts": True,
        "font.family": "sans-serif",
        "font.sans-serif": ["Helvetica"],
        "pdf.compression": 0,  # the same bytes by every zlib, and texts that can be searched
        "path.simplify": False,
        "lines.scale_dashes": False,
    }
    with rc_context(settings):
        figure = Figure(figsize=(width / 25.4, height / 25.4))
        axes = figure.add_axes((0, 0, 1, 1), xlim=(0, width), ylim=(0, height))
        axes.axis("off")
        for stroke in (*sheet.strokes, *(stroke for _, _, stroke in strokes_of_views(sheet))):
            if stroke.filled:
                axes.fill(*stroke.points.T, color="black", linewidth=0)
                continue
            dashes = [length * POINTS for length in DASHES.get(stroke.style, ())]
            style = (0, dashes) if dashes else "solid"
            thickness = WIDTHS[stroke.style] * POINTS
            axes.plot(*stroke.points.T, color="black", linewidth=thickness, linestyle=style)
        for label in sheet.labels:
            axes.text(
                *label.position,
                label.text,
                fontsize=label.height / CAPITALS * POINTS,
                horizontalalignment={"start": "left", "middle": "center", "end": "right"}[label.anchor],
                verticalalignment="baseline",
                fontweight="medium",  # as its metrics call it
                rotation=label.angle,
                rotation_mode="anchor",
                parse_math=False,
            )
        figure.savefig(buffer, format="pdf", metadata={"Title": sheet.name, "CreationDate": None})
    return buffer.getvalue()
