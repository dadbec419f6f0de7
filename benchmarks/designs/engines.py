"""The engines side by side: time to the first gradient, time and error of a gradient, and whole designs.

Run: thbcad bench engines

Every engine runs in a process of its own, on all cores, in Mitsuba's variant llvm_ad_mono.  Its gradient is
that of the last level's loss near the start of the optimisation, with equally many rays; that of the exact
engine is the reference.  One row asks the particle tracer at the unshaped lens too, where the gradient is
large.  The first gradient counts from the start of the process, with kernels that an earlier run compiled.
All designs are measured by the exact tracer.  The particle tracer with screen and camera has noisy
gradients; its whole designs are among those of `thbcad bench designs`.

The last rows compare the picture that Mitsuba renders of the scene of the pearl's lens with our irradiance,
on blocks of pixels, beside its noise.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.engine_run import PTRACER, EngineRun, run_engine
from benchmarks.rows.row import Row
from optics.base.runtime import load_backend
from optics.designing.optimisation import shape_lens
from optics.light.analysis import measure
from optics.light.engines import ExactEngine
from optics.scene.keys import problem_to_toml
from optics.scene.problem import Problem, load_problem
from optics.scene.system import System
from thbcad import Lens, write_lens

EXACT, RENDERED = "exact", "mitsuba-exact"
ENGINES = (EXACT, RENDERED, "mitsuba-mesh", PTRACER)
PEARL_LEVEL, PEARL_MERGE = 3, 2  # of five levels in the example; 128^2 pixels
NEAR = 2  # iterations behind the start at which gradients are compared
BLOCK = 16  # pixels of a picture that are merged in each direction
PATHS = 256  # per pixel of a picture

Floats = NDArray[np.float64]


def rows() -> list[Row]:
    """Return the measured rows."""
    engines = ENGINES if find_spec("mitsuba") else ENGINES[:1]
    out = []
    for name, problem in problems():
        with tempfile.TemporaryDirectory() as folder:
            file, lens_file = Path(folder) / "problem.toml", Path(folder) / "lens.json"
            file.write_text(problem_to_toml(problem), "utf-8")
            lens = _begun(problem)
            write_lens(lens, lens_file)
            runs = {e: run_engine(file, lens_file, e, e != PTRACER) for e in engines}
        for engine, run in runs.items():
            out += _engine_rows(f"{name}: {engine}", engine, run, runs[EXACT])
        out += [_far_off(name, problem)] if len(engines) > 1 else []
    return [*out, *(_picture_rows(lens, problem) if len(engines) > 1 else [])]


def problems() -> Iterator[tuple[str, Problem]]:
    """Yield names and problems, the pearl last."""
    yield "square top hat", load_problem(EXAMPLES / "tophat_square.toml")
    pearl = load_problem(EXAMPLES / "pearl.toml")
    freeform = replace(pearl.lens.rear.freeform, max_level=PEARL_LEVEL)
    lens = replace(pearl.lens, rear=replace(pearl.lens.rear, freeform=freeform))
    optimizer = replace(pearl.optimizer, merge=PEARL_MERGE)
    yield "coarse pearl", replace(pearl, lens=lens, optimizer=optimizer)


def _begun(problem: Problem) -> Lens:
    """Return the lens of a problem after few iterations."""
    system = System(replace(problem, optimizer=replace(problem.optimizer, iterations=(NEAR,))))
    backend = load_backend("double")
    return shape_lens(system, backend, ExactEngine(backend))[0].designed


def _far_off(name: str, problem: Problem) -> Row:
    """Return the cosine of the particle tracer's gradient with the exact one where much is to be gained."""
    freeform = replace(problem.lens.rear.freeform, max_level=0)
    lens = replace(problem.lens, rear=replace(problem.lens.rear, freeform=freeform))
    flat = replace(problem, lens=lens, optimizer=replace(problem.optimizer, start="flat"))
    with tempfile.TemporaryDirectory() as folder:
        file, lens_file = Path(folder) / "problem.toml", Path(folder) / "lens.json"
        file.write_text(problem_to_toml(flat), "utf-8")
        write_lens(System(flat).base, lens_file)
        one, other = (run_engine(file, lens_file, engine, False).gradient for engine in (EXACT, PTRACER))
    cosine = float(one @ other / (np.linalg.norm(one) * np.linalg.norm(other)))
    return Row(f"{name}: {PTRACER}, gradient's cosine at the unshaped lens, level 0", cosine)


def _engine_rows(name: str, engine: str, run: EngineRun, exact: EngineRun) -> list[Row]:
    g, e = run.gradient, exact.gradient
    error = float(np.linalg.norm(g - e) / np.linalg.norm(e))
    cosine = float(g @ e / (np.linalg.norm(g) * np.linalg.norm(e)))
    out = [
        Row(f"{name}: first gradient", run.first, "s"),
        Row("  time of a gradient", run.each, "s"),
        Row("  gradient's error, relative", error, "", "", 1e-6 if engine == RENDERED else None),
        Row("  gradient's cosine with the exact one", cosine),
    ]
    if run.seconds:
        apart = abs(run.rel_l2 - exact.rel_l2)
        ratio = run.seconds / exact.seconds
        rendered = engine == RENDERED
        out += [
            Row("  rel_l2 of the design", run.rel_l2),
            Row("  its distance from that of the exact engine", apart, "", "", 1e-3 if rendered else None),
            Row("  wall time of the design", run.seconds, "s"),
            Row("  to that of the exact engine", ratio, "", "", 3 if rendered else None),
        ]
    return [*out, Row("  peak memory", run.peak, "MB")]


def _picture_rows(lens: Lens, problem: Problem) -> list[Row]:
    """Return the distance of Mitsuba's picture of a scene from our irradiance, and its noise."""
    from optics.exchange.mitsuba import LensMesh, camera_irradiance, load_mitsuba, mitsuba_scene

    load_mitsuba()
    system = System(problem)
    scene = mitsuba_scene(system, LensMesh.uniform(lens, (449, 449)))
    pictures = [_blocks(camera_irradiance(scene, PATHS, seed)) for seed in (1, 2)]
    ours = _blocks(measure(system.with_lens(lens), load_backend("double")).irradiance)
    mean = (pictures[0] + pictures[1]) / 2
    noise = np.linalg.norm(pictures[0] - pictures[1]) / 2
    scale = np.linalg.norm(ours)
    return [
        Row(
            f"picture of the pearl's scene, blocks of {BLOCK}^2 pixels: distance from ours",
            float(np.linalg.norm(mean - ours) / scale),
            "",
            "with light that is reflected twice in the lens",
        ),
        Row("  its noise", float(noise / scale), "", f"2 x {PATHS} paths per pixel"),
    ]


def _blocks(image: Floats) -> Floats:
    rows, columns = (n // BLOCK for n in image.shape)
    return image.reshape(rows, BLOCK, columns, BLOCK).mean((1, 3))
