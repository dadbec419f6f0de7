"""Starts of designs for twenty thin and bright pictures on black, and some of the designs.

Run: thbcad bench on_black [--quick]
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
from PIL import Image

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import rel_l2_row, run_design
from benchmarks.designs.pictures_on_black import PICTURES, picture
from benchmarks.rows.row import Row
from optics.base.runtime import Backend, load_backend
from optics.designing.prediction import resolved
from optics.designing.starts import TransportStart, light_before
from optics.scene.keys import AUTO, problem_to_toml
from optics.scene.problem import Problem, load_problem
from optics.scene.system import System

PEARL = EXAMPLES / "pearl.toml"
SIZE, LEVEL = 256, 5
HALF = (47.5, 47.5)  # mm, of the target: the picture is as large as the beam
THICKNESS = 50.0  # mm: light of a dot is gathered from the whole beam, by a surface that bulges this much
START, DESIGN = 0.3, 0.03  # wanted of each
# designs on fewer pixels, refined as far as the program finds useful
DESIGNED = "wide ring", "ring and triangle", "star", "one pixel of 10 000"
SMALL_SIZE = 128


def rows(quick: bool = False) -> list[Row]:
    """Return misfit, dual gap, steps and seconds of every start, and the misfit of some designs.

    quick : no designs.
    """
    with tempfile.TemporaryDirectory() as folder:
        out = [row for name in PICTURES for row in _start(Path(folder), name)]
        return out if quick else out + [_design(Path(folder), name) for name in DESIGNED]


def problem_on_black(folder: Path, name: str, size: int, level: int | str) -> Problem:
    """Return the problem of a lens with a picture of `size` pixels, whose base is left to the program.

    level : of the finest mesh.
    """
    path = folder / f"{name}.png"
    Image.fromarray(np.uint8(np.round(255 * picture(name, size)))).save(path)
    problem = load_problem(PEARL)
    freeform = replace(problem.lens.rear.freeform, z_freedom=AUTO, max_level=level)
    rear = replace(problem.lens.rear, freeform=freeform, radius=AUTO)
    target = replace(problem.target, image=str(path), encoding="linear", half_width=HALF, pixels=(size, size))
    lens = replace(problem.lens, rear=rear, thickness=THICKNESS)
    return replace(problem, title=name, lens=lens, target=target)


def start_of(system: System, backend: Backend) -> tuple[TransportStart, float, float]:
    """Return the start of a system, the rel_l2 of its light, and the seconds that the start took."""
    clock = perf_counter()
    start = TransportStart(system, backend)
    seconds = perf_counter() - clock
    lens = system.base.with_sags([start.finest_fit().sag])
    misfit = light_before(system.with_lens(lens), backend)[1]
    assert misfit is not None, "the light has no extent"
    return start, misfit, seconds


def _start(folder: Path, name: str) -> Iterator[Row]:
    backend = load_backend("double")
    system, _ = resolved(System(problem_on_black(folder, name, SIZE, LEVEL)), backend)
    start, misfit, seconds = start_of(system, backend)
    yield Row(f"{name}: rel_l2 of the start", misfit, limit=START)
    yield Row(f"{name}: dual gap of its map, relative", start.gap)
    yield Row(f"{name}: steps of its map", start.steps)
    yield Row(f"{name}: seconds of the start", seconds, "s")


def _design(folder: Path, name: str) -> Row:
    path = folder / "problem.toml"
    path.write_text(problem_to_toml(problem_on_black(folder, name, SMALL_SIZE, AUTO)), "utf-8")
    metrics = run_design(path, folder / "result", must_pass=False).metrics
    return rel_l2_row(f"{name}: rel_l2 of the design, {SMALL_SIZE} pixels", metrics, limit=DESIGN)
