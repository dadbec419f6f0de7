"""Pictures for notebooks: numbers on a grid as colours, a PNG with a palette inside SVG, and a picture beside
a few numbers, as HTML.
"""

import zlib
from base64 import b64encode
from collections.abc import Iterable
from html import escape

import numpy as np
from numpy.typing import NDArray

from thbcad.checks import Floats

COLOURS = np.array(  # from low to high, dark to bright; equal steps between them
    [(68, 1, 84), (65, 68, 135), (42, 120, 142), (34, 168, 132), (122, 209, 81), (253, 231, 37)]
)
SIGNATURE = b"\x89PNG\r\n\x1a\n"
PALETTE = 3  # the PNG type of pixels that are numbers of colours
LONGEST = 260.0  # pixels: the longer side of a picture
SLIMMEST = 0.25  # of the longer side: the shorter one, at least
STYLE = "display:flex;flex-wrap:wrap;gap:1em;align-items:center;font:13px/1.4 system-ui,sans-serif"


def map_element(values: Floats, width: float, height: float) -> str:
    """Return an SVG element that shows numbers by colour.

    values : (columns, rows), as on a grid of u to the right and v upwards.  The least is dark, the greatest
        bright; where all are equal, the middle colour is shown.
    """
    low, high = values.min(), values.max()
    with np.errstate(all="ignore"):  # differences of numbers near 1e308
        part = np.nan_to_num((values - low) / (high - low), nan=0.5)
    png = _png(np.rint(255 * np.clip(part, 0, 1)).astype(np.uint8).T[::-1])
    return (
        f'<image width="{width:g}" height="{height:g}" preserveAspectRatio="none" '
        f'href="data:image/png;base64,{b64encode(png).decode()}"/>'
    )


def _png(levels: NDArray[np.uint8]) -> bytes:
    """Return a PNG of colour numbers (rows, columns).  Source: ISO/IEC 15948 (PNG), clauses 5 and 11."""
    rows, columns = levels.shape
    header = np.array([columns, rows], ">u4").tobytes() + bytes([8, PALETTE, 0, 0, 0])
    at = np.linspace(0, len(COLOURS) - 1, 256)
    colours = np.stack([np.interp(at, np.arange(len(COLOURS)), c) for c in COLOURS.T], axis=1)
    unfiltered = np.pad(levels, ((0, 0), (1, 0))).tobytes()  # every row begins with its filter, 0
    chunks = [
        (b"IHDR", header),
        (b"PLTE", np.rint(colours).astype(np.uint8).tobytes()),
        (b"IDAT", zlib.compress(unfiltered, 9)),
        (b"IEND", b""),
    ]
    return SIGNATURE + b"".join(
        len(data).to_bytes(4, "big") + name + data + zlib.crc32(name + data).to_bytes(4, "big")
        for name, data in chunks
    )


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
