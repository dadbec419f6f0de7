"""Numbers on a grid as colours: a PNG with a palette, inside SVG."""

from __future__ import annotations

import zlib
from base64 import b64encode

import numpy as np
from numpy.typing import NDArray

from thbcad.checks import Floats

COLOURS = np.array(  # from low to high, dark to bright; equal steps between them
    [(68, 1, 84), (65, 68, 135), (42, 120, 142), (34, 168, 132), (122, 209, 81), (253, 231, 37)]
)
SIGNATURE = b"\x89PNG\r\n\x1a\n"
PALETTE = 3  # the PNG type of pixels that are numbers of colours


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
