"""One result that can be opened without installing the program: report, view, solid and exact surfaces."""

from __future__ import annotations

import io
import json
import re
import shutil
from base64 import b64decode, b64encode
from pathlib import Path

from PIL import Image

from benchmarks.gallery.small_pictures import webp
from optics.base.runtime import load_backend
from optics.exchange.results import HASHES, hashes
from optics.interface.api import Design
from optics.reporting.view import scene_page, scene_paths
from thbcad.io import json_text, write_text

RECORD, REPORT, VIEW = "result.json", "report.html", "view.html"
PNG = re.compile("data:image/png;base64,([A-Za-z0-9+/=]+)")


def write_opened(result: Path, folder: Path) -> None:
    """Copy a result folder but for its figures, which the report holds, and add its view as a page.

    The pictures of the report become WebP, a fifth of the bytes, and the record says so.  What was in the
    folder before is removed.
    """
    design = Design.load(result)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for path in result.iterdir():
        if path.is_file():
            shutil.copyfile(path, folder / path.name)
    write_text(folder / REPORT, PNG.sub(_smaller, (result / REPORT).read_text("utf-8")))
    record = json.loads((folder / RECORD).read_text("utf-8"))
    kept = [name for name in record[HASHES] if (folder / name).exists()]
    write_text(folder / RECORD, json_text(record | {HASHES: hashes(folder, kept)}))
    paths = scene_paths(design.system, load_backend("double"))
    write_text(folder / VIEW, scene_page(design.system, design.measurement.irradiance, paths))


def _smaller(png: re.Match[str]) -> str:
    """Return a picture that stands in a page as WebP."""
    with Image.open(io.BytesIO(b64decode(png[1]))) as picture:
        return f"data:image/webp;base64,{b64encode(webp(picture)).decode()}"
