"""One result that can be opened without installing the program: report, view, solid and exact surfaces."""

from __future__ import annotations

import shutil
from pathlib import Path

from optics.api import Design
from optics.figures import scene_paths
from optics.runtime import load_backend
from optics.view import scene_page
from thbcad.io import write_text

VIEW = "view.html"


def write_opened(result: Path, folder: Path) -> None:
    """Copy a result folder but for its figures, which the report holds, and add its view as a page.

    What was in the folder before is removed.
    """
    design = Design.load(result)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for path in sorted(result.iterdir()):
        if path.is_file() and not path.name.startswith("."):
            shutil.copyfile(path, folder / path.name)
    system = design.system
    paths = scene_paths(system, design.lens, load_backend("double"))
    write_text(folder / VIEW, scene_page(system, design.lens, design.measurement.irradiance, paths))
