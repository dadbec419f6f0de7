"""One engine in a process of its own: its first gradient, its next ones, and a whole design.

The parent runs it by `run_engine`.  The gradient is that of the last level's objective on a lens that the
parent names; engines trace equally many rays for it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, time

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import ROOT
from benchmarks.designs.camera_engine import camera_engine
from benchmarks.rows.row import median_seconds
from optics.base.runtime import load_backend, peak_mb
from optics.designing.optimisation import shape_lens, stage_objective, stages, transmitted_flux
from optics.interface.api import engine_of
from optics.light.analysis import measure
from optics.scene.problem import load_problem
from optics.scene.system import System
from thbcad import read_lens

REPEATS = 5
PTRACER = "mitsuba-ptracer"  # the name of `camera_engine` in rows


@dataclass(frozen=True, eq=False)
class EngineRun:
    """What an engine was measured to do.

    first : seconds from the start of the process to its first gradient.  each : seconds of those that follow.
    gradient : of the loss, (dim,).  peak : MB, of the process.
    seconds, rel_l2 : of a whole design, where one was asked for, or 0.
    """

    first: float
    each: float
    gradient: NDArray[np.float64]
    peak: float
    seconds: float
    rel_l2: float


def run_engine(problem: Path, lens: Path, engine: str, whole: bool) -> EngineRun:
    """Measure an engine in a process of its own.

    lens : a file of the lens for the gradient.  whole : design the lens too.

    Raises CalledProcessError : the process fails.
    """
    gradient = lens.with_name(f"{engine}.npy")
    arguments = [str(problem), str(lens), engine, str(gradient), str(int(whole)), str(time())]
    command = [sys.executable, "-m", "benchmarks.designs.engine_run", *arguments]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    return EngineRun(gradient=np.load(gradient), **json.loads(done.stdout.splitlines()[-1]))


def main(arguments: list[str]) -> None:
    """Measure what the arguments of `run_engine` say, and print it as a line of JSON."""
    problem, lens_file, name, file, whole, started = arguments
    system = System(load_problem(problem))
    near = system.with_lens(read_lens(lens_file))
    backend = load_backend("double")
    engine = camera_engine() if name == PTRACER else engine_of(name, system, backend)
    stage = stages(system, True)[-1]
    target = system.target.irradiance(stage.screen, transmitted_flux(system, backend))
    objective = stage_objective(near, stage, target, engine)
    at = [sag.coefficients for sag in near.sags]
    gradient = np.concatenate(objective(at).gradients)
    found = {"first": time() - float(started), "each": median_seconds(lambda: objective(at), REPEATS)}
    np.save(file, gradient)
    found |= {"seconds": 0.0, "rel_l2": 0.0}
    if int(whole):
        start = perf_counter()
        designed, _ = shape_lens(system, backend, engine)
        found["seconds"] = perf_counter() - start
        found["rel_l2"] = measure(designed, backend).metrics["rel_l2"]
    print(json.dumps(found | {"peak": peak_mb()}))


if __name__ == "__main__":
    main(sys.argv[1:])
