"""Pictures of the pages: figures that a benchmark drew, kept in docs/pictures."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image

from benchmarks.checkout import ROOT
from thbcad.io import write_bytes

PICTURES = ROOT / "docs" / "pictures"


def keep(figure: Path, name: str) -> None:
    """Write a PNG figure as docs/pictures/NAME.webp, without loss."""
    buffer = io.BytesIO()
    Image.open(figure).convert("RGB").save(buffer, "webp", lossless=True, method=6)
    PICTURES.mkdir(exist_ok=True)
    write_bytes(PICTURES / f"{name}.webp", buffer.getvalue())
