"""The pictures of all variants side by side."""

from __future__ import annotations

import io
import math

from optics.interface.sweeps.sweep_rows import Sweep, SweepRow
from optics.interface.sweeps.sweep_tables import cell

MOST = 400  # pictures: 20 x 20 still fit on a screen
TILE, LINE, GAP = 96, 11, 6  # pixels: of a picture, of a line of text below it, between them
MOST_LETTERS = 18  # of a line: a tile is no wider


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
