"""The files of a result: their names, by what a problem has."""

import re
from collections.abc import Iterable
from pathlib import Path

from optics.exchange.results.identity import DATA, data_of, stored_name
from optics.scene.problem import Problem

RECORD, CHECKPOINT = "result.json", "checkpoint.json"
CHECKED = ("metrics.json", "verify.json", "manufacture.json")
LIGHT = ("irradiance.npz", "irradiance_16bit.png")
FIGURES = tuple(
    f"figures/{name}.png"
    for name in (
        *("photo", "target", "irradiance", "error", "irradiance_02", "sharp", "colour", "fringe"),
        *("polar", "isocandela", "rays_1", "rays_2"),
        *("sag", "mesh", "front_sag", "front_mesh", "face_sag", "face_mesh"),
        *("loss", "scene", "solid"),
        "solid_before",  # of version 0.3.0 and before
    )
)
# what says how good a result is, the record first: gone before the first new file is written
CLAIMS = (RECORD, "report.html", *CHECKED, *LIGHT, *FIGURES)
FILES = ("problem.toml", "lens.json", "lens.step", "history.csv", *CLAIMS)
SCENE = "scene.step"  # of all elements in their places
# of an element, or of the whole scene
PART_FILE = re.compile(r"[\w-]+\.(step|lens\.json)|figures/[\w-]+_(sag|mesh)\.png")
LEVEL_FILE = re.compile(r"level_\d+\.(json|npz)|figures/level_\d+\.png")
FILES_OF_A_LEVEL = 3  # lens, arrays, picture


def is_result_file(name: str) -> bool:
    """Return whether a run writes a file of this name."""
    data = "/" not in name and Path(name).stem in DATA
    return name in FILES or data or any(kind.fullmatch(name) for kind in (LEVEL_FILE, PART_FILE))


def part_files(problem: Problem) -> list[str]:
    """Return the names of the files of the other elements, and of the scene where there are some."""
    others = [optic for optic in problem.optics if optic is not problem.optic]
    steps = [f"{optic.called}.step" for optic in others]
    shapes = [shape_file(optic.called) for optic in others if optic.free]
    figures = [
        f"figures/{optic.called}_{optic.face_name(face)}_{what}.png"
        for optic in others
        for face in optic.free
        for what in ("sag", "mesh")
    ]
    return [*steps, *shapes, *figures, SCENE] if others else []


def beside(problem: Problem) -> list[str]:
    """Return a sentence on which of several free elements lens.json is; none where there is one."""
    others = [optic.called for optic in problem.free_optics if optic is not problem.optic]
    if not others:
        return []
    files = ", ".join(shape_file(name) for name in others)
    return [f"this is {problem.optic.called} alone, the last of the free elements; the others are in {files}"]


def shape_file(name: str) -> str:
    """Return the native file of a free element that is not that of lens.json."""
    return f"{name}.lens.json"


def is_level_file(name: str) -> bool:
    """Return whether a run that keeps its levels writes a file of this name."""
    return LEVEL_FILE.fullmatch(name) is not None


def level_files(count: int) -> list[tuple[str, str, str]]:
    """Return the names of lens, arrays and picture of the levels that a result keeps."""
    return [(f"level_{k}.json", f"level_{k}.npz", f"figures/level_{k}.png") for k in range(count)]


def pictures_of(problem: Problem) -> Iterable[str]:
    """Return the names under which a result keeps the files of the problem: pictures and rays."""
    return [stored_name(table, path) for table, _, path in data_of(problem)]
