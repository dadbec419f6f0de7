"""Every example, those of the [gallery](gallery.md) first, as a user designs it: time, error and light.

Run: thbcad bench gallery; `make gallery` stores the rows, and writes the page and its pictures.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from benchmarks.checkout import BUILD, EXAMPLES, ROOT
from benchmarks.designs.design_run import DesignRun, rel_l2_row, run_design
from benchmarks.gallery.flagship import flagship
from benchmarks.gallery.gallery_page import (
    ERROR,
    FUNCTIONS,
    LIGHT,
    SECONDS,
    SHARE,
    UNIFORMITY,
    commands,
    page_text,
)
from benchmarks.gallery.lenses import LENSES, Shown
from benchmarks.gallery.opened_result import write_opened
from benchmarks.gallery.other_examples import other_examples
from benchmarks.gallery.small_pictures import (
    cells_picture,
    lens_picture,
    light_picture,
    mesh_picture,
    scene_picture,
)
from benchmarks.page_picture import keep
from benchmarks.rows.row import Row
from benchmarks.rows.stored_rows import read_rows
from optics.base.runtime import UserError
from optics.exchange.export import read_mesh
from thbcad import Lens, read_lens
from thbcad.io import write_bytes

DESIGNS = BUILD / "gallery"
PAGE, PICTURES = ROOT / "docs" / "gallery.md", ROOT / "docs" / "gallery"
CRESCENT = ROOT / "optics" / "interface" / "audit" / "crescent.toml"
FEW = "alpha = [1.0]\n"  # of [refinement]
OPENED = "street"  # the lens whose result is kept as a whole: two free surfaces, in few bytes
LARGE = {"pearl": ("scene", "target", "irradiance", "solid"), "disk": ("mesh",)}  # figures of other pages
CHORD = "0.05"  # mm, of meshes that are drawn: less than a pixel of their pictures


def rows(only: int | None = None) -> list[Row]:
    """Design the lenses of the gallery and all other examples into build/gallery, and return time, error,
    light and degrees of freedom of each.

    only : the number of one lens, from 1.
    """
    if only is not None and not 1 <= only <= len(LENSES):
        raise UserError(f"--only must be a number from 1 to {len(LENSES)}, got {only}")
    DESIGNS.mkdir(parents=True, exist_ok=True)
    chosen = LENSES if only is None else LENSES[only - 1 : only]
    runs = {lens.name: _designed(lens) for lens in chosen}
    if only is None:
        for name, problem in other_examples().items():
            runs[name] = run_design(problem, DESIGNS / name, must_pass=False)  # the light of some is a study
    table = [row for name, run in runs.items() for row in _rows(name, run)]
    return [*table, Row("all", sum(run.seconds for run in runs.values()), "s")]


def _designed(lens: Shown) -> DesignRun:
    """Design a lens; where its body is another, export that, and as a mesh that can be drawn."""
    out = DESIGNS / lens.name
    run = run_design(EXAMPLES / lens.problem, out)
    for arguments in commands(lens, str(out))[1:]:
        for options in ([], ["--out", f"{out}.stl", "--chord", CHORD]):  # the last --out counts
            command = [sys.executable, "-m", "optics", *arguments, *options, "--force"]
            subprocess.run(command, check=True, capture_output=True, cwd=ROOT)
    return run


def _rows(name: str, run: DesignRun) -> list[Row]:
    least = (run.metrics.get("uniformity") or {}).get("min_over_mean")
    return [
        rel_l2_row(f"{name}: {ERROR}", run.metrics),
        *([] if least is None else [Row(f"{name}: {UNIFORMITY}", least)]),
        Row(f"{name}: {SECONDS}", run.seconds, "s"),
        Row(f"{name}: {LIGHT}", run.metrics["efficiency"]),
        Row(f"{name}: {FUNCTIONS}", run.metrics["dof"]),
        Row(f"{name}: {SHARE}", share_of_uniform(read_lens(DESIGNS / name / "lens.json"))),
    ]


def share_of_uniform(lens: Lens) -> float:
    """Return the functions of the free surfaces, over those of uniform meshes of their finest levels."""
    spaces = [sag.space for sag in lens.sags if sag is not None]
    return sum(space.dim for space in spaces) / sum(space.uniform(space.levels - 1).dim for space in spaces)


def publish() -> None:
    """Write the pictures into docs/gallery and docs/pictures, and one whole result into docs/result."""
    PICTURES.mkdir(exist_ok=True)
    for lens in LENSES:
        for kind, picture in pictures_of(lens).items():
            write_bytes(PICTURES / f"{lens.name}_{kind}.webp", picture)
    write_opened(DESIGNS / OPENED, ROOT / "docs" / "result")
    write_flagship()
    for name, figures in LARGE.items():
        for figure in figures:
            keep(DESIGNS / name / "figures" / f"{figure}.png", f"{name}_{figure}")


def write_flagship() -> None:
    """Design the crescent of `refinement` with few functions, and draw the figure of the first pages."""
    problem = DESIGNS / "crescent.toml"
    problem.write_text(f"{CRESCENT.read_text('utf-8')}{FEW}", "utf-8")  # [refinement] is its last table
    run_design(problem, DESIGNS / "crescent")
    picture = flagship(DESIGNS / "crescent", read_rows(ROOT / "docs" / "data")["refinement"])
    write_bytes(ROOT / "docs" / "pictures" / "flagship.webp", picture)


def pictures_of(lens: Shown) -> dict[str, bytes]:
    """Return the pictures of a designed lens as WebP, by what they show."""
    folder = DESIGNS / lens.name
    return {
        "scene": scene_picture(folder / "figures" / "scene.png"),
        "light": light_picture(folder / "irradiance.npz"),
        "solid": _solid(lens, folder),
        "mesh": cells_picture(_mesh(folder / "figures")),
    }


def _mesh(figures: Path) -> Path:
    """Return the picture of the mesh of the last free surface."""
    return max(figures.glob("*mesh.png"), key=lambda path: path.name == "mesh.png")


def _solid(lens: Shown, folder: Path) -> bytes:
    if lens.body:
        return mesh_picture(read_mesh(folder.with_suffix(".stl"), "stl"))
    return lens_picture(read_lens(folder / "lens.json"))


def pages() -> dict[Path, str]:
    """Return the text of the page by its path, from the stored rows."""
    return {PAGE: page_text(read_rows(ROOT / "docs" / "data"))}
