"""Designs for pictures that nothing was tuned on: photographs, textures, line art, text, smooth waves.

Run: thbcad bench untuned
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import rel_l2_row, run_design
from benchmarks.rows.row import Row
from optics.base.runtime import load_backend
from optics.designing.prediction import expected
from optics.scene.keys import AUTO, problem_to_toml
from optics.scene.problem import Optimizer, load_problem
from optics.scene.system import System

PEARL = EXAMPLES / "pearl.toml"
Z_FREEDOM = 19.0  # mm: busy pictures ask for more sag than the pearl
SIZE = 512
WANTED = 0.03  # of the worst picture
BUNDLED = (  # more pictures of scikit-image
    "brick.png",
    "cell.png",
    "chelsea.png",
    "chessboard_GRAY.png",
    "clock_motion.png",
    "coffee.png",
    "gravel.png",
    "logo.png",
    "moon.png",
    "page.png",
    "retina.jpg",
    "rocket.jpg",
)


def rows() -> list[Row]:
    """Return relative error, PSNR and seconds for every picture."""
    out = []
    with tempfile.TemporaryDirectory() as folder:
        for name, picture in pictures():
            metrics = _design(Path(folder), name, picture)
            out.append(rel_l2_row(f"{name}: rel_l2", metrics, f"level {metrics['levels'] - 1}", WANTED))
            out.append(Row(f"{name}: psnr", metrics["psnr_db"], "dB"))
            out.append(Row(f"{name}: efficiency", metrics["efficiency"]))
            out.append(Row(f"{name}: wall time without imports", metrics["wall_s"]["total"], "s"))
            out += _predictions(Path(folder), name, metrics)
    return out


def pictures() -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """Yield names and pictures; the photographs are those that scikit-image carries."""
    import skimage
    from skimage import data, io

    yield "photographer", data.camera()
    yield "astronaut", data.astronaut()
    yield "coins", data.coins()
    yield "line art, not square", np.where(data.horse(), 255, 0).astype(np.uint8)
    yield "galaxies, mostly black", data.hubble_deep_field()
    x, y = np.meshgrid(*[(np.arange(SIZE) + 0.5) / SIZE] * 2)
    yield "smooth waves", np.round(127 + 100 * np.sin(9 * x + 2 * y) * np.cos(7 * y)).astype(np.uint8)
    yield "disk on black", (255 * ((x - 0.5) ** 2 + (y - 0.5) ** 2 < 0.3**2)).astype(np.uint8)
    page = Image.new("L", (SIZE // 8, SIZE // 8))
    for row, word in enumerate(("light", "shapes", "glass")):
        ImageDraw.Draw(page).text((8, 8 + 16 * row), word, fill=255)
    yield "white text on black", np.asarray(page.resize((SIZE, SIZE)))
    folder = Path(skimage.__file__).parent / "data"
    for name in BUNDLED:
        yield name.split(".")[0].replace("_", " "), io.imread(folder / name)


def _predictions(folder: Path, name: str, metrics: dict[str, Any]) -> list[Row]:
    """Return what `thbcad check` says of the design, over what came: 1 is exact."""
    system, backend = System(load_problem(folder / name / "problem.toml")), load_backend("double")
    said, _ = expected(system, backend)
    ratios = {
        "seconds": said.seconds / metrics["wall_s"]["total"],
        "memory": said.memory_mb / metrics["peak_mb"],
    }
    if said.rel_l2 is not None:  # meshes much coarser than pixels have no prediction
        ratios["rel_l2"] = said.rel_l2 / metrics["rel_l2"]
    return [Row(f"{name}: predicted {what} / measured", ratio) for what, ratio in ratios.items()]


def _design(folder: Path, name: str, picture: NDArray[np.uint8]) -> dict[str, Any]:
    """Return the metrics of the pearl design with another picture."""
    Image.fromarray(picture).save(folder / "picture.png")
    problem = load_problem(PEARL)
    freeform = replace(problem.lens.rear.freeform, z_freedom=Z_FREEDOM, max_level=AUTO)
    rear, options = replace(problem.lens.rear, freeform=freeform), Optimizer()
    lens, target = replace(problem.lens, rear=rear), replace(problem.target, image="picture.png")
    path = folder / "problem.toml"
    problem = replace(problem, title=name, lens=lens, target=target, optimizer=options)
    path.write_text(problem_to_toml(problem), "utf-8")
    return run_design(path, folder / name).metrics
