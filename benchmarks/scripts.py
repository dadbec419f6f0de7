"""What scripts pay and get: the examples of examples/scripts, the cost of the API, and its gradient.

Run: thbcad bench scripts
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from statistics import median
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

import optics
from benchmarks.checkout import EXAMPLES
from benchmarks.rows.row import Row
from optics.base.runtime import load_backend
from optics.designing.optimisation import (
    MARGIN,
    Objective,
    penalised_objective,
    transmitted_flux,
    window_named,
)
from optics.light.engines import ExactEngine, Film
from thbcad import THBSpace, THBSurface

SECONDS = 60.0  # of a script
CALLS = 60  # of both losses, in turn
IMPORTS = 7
RAYS, WINDOW, LEVEL = (449, 449), "pixel", 2
DIRECTIONS = 5
STEP = 1e-6  # mm, of central differences of fourth order
OFF = 0.98  # of the start's coefficients: where the loss has slopes

Floats = NDArray[np.float64]


def rows() -> list[Row]:
    """Return the measured rows."""
    out = [row for path in sorted((EXAMPLES / "scripts").glob("*.py")) for row in _script(path.stem)]
    for name, names, limit in (
        ("import optics, fresh process", "pass", 0.3),
        ("   and optics.System: numpy and scipy come too", "optics.System", None),
    ):
        seconds = median(_import_seconds(names) for _ in range(IMPORTS))
        out.append(Row(name, seconds, "s", "", limit))
    system = optics.System(optics.load_problem(EXAMPLES / "tophat_circle.toml"))
    return [*out, *_cost(system), *_gradient(system)]


def _script(name: str) -> list[Row]:
    """Return the time of a script, process start to end, and the error that it prints last."""
    start = perf_counter()
    command = [sys.executable, str(EXAMPLES / "scripts" / f"{name}.py")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    seconds = perf_counter() - start
    error = float(re.findall(r"rel_l2 ([\d.]+)", done.stdout)[-1])
    return [
        Row(f"{name}: time", seconds, "s", "", SECONDS),
        Row(f"{name}: rel_l2", error, "", "start 0.0315"),
    ]


def _import_seconds(names: str) -> float:
    program = f"from time import perf_counter as now; t = now(); import optics; {names}; print(now() - t)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return float(done.stdout)


def _cost(system: optics.System) -> list[Row]:
    """Return the times of the loss through the API and of the bare objective, called in turn."""
    space = system.space(LEVEL)
    model, bare = system.model(space, RAYS, WINDOW), _objective(system, space)
    c = system.transport_start(space).coefficients
    if model.loss(c)[0] != bare([c]).loss:
        raise ValueError("the two losses differ")
    times = np.array([(_seconds(lambda: model.loss(c)), _seconds(lambda: bare([c]))) for _ in range(CALLS)])
    through, alone = np.median(times, axis=0).tolist()
    return [
        Row(f"loss and gradient through the API, {RAYS[0]}^2 rays", through, "s"),
        Row("   to the bare objective", through / alone, "", f"{alone:.3g} s", 1.05),
    ]


def _seconds(call: Callable[[], object]) -> float:
    start = perf_counter()
    call()
    return perf_counter() - start


def _objective(system: optics.System, space: THBSpace) -> Objective:
    """Return the objective of a design's level, put together by hand."""
    optical, run = system, system.problem.run
    backend = load_backend(run.precision, run.threads)
    film = Film(optical.target.screen(margin=MARGIN), RAYS, window_named(system.problem, WINDOW))
    lens = optical.base.with_sags([THBSurface(space, np.zeros(space.dim))])
    light = ExactEngine(backend).model(optical.with_lens(lens), film)
    target = optical.target.irradiance(optical.target.screen(), transmitted_flux(optical, backend))
    return penalised_objective(optical.with_lens(lens), light, target)


def _gradient(system: optics.System) -> list[Row]:
    """Return the greatest error of slopes of the loss, relative to the gradient's norm."""
    space, rng, out = system.space(LEVEL), np.random.default_rng(0), []
    c = OFF * system.transport_start(space).coefficients
    for window in ("bspline", "cells"):
        model = system.model(space, RAYS, window)
        _, gradient = model.loss(c)
        directions = rng.standard_normal((DIRECTIONS, space.dim))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        errors = [abs(_slope(model, c, d) - gradient @ d) / np.linalg.norm(gradient) for d in directions]
        name = f"gradient of the loss against central differences, {window}"
        out.append(Row(name, max(errors), "", "", 1e-8))
    return out


def _slope(model: optics.Model, c: Floats, direction: Floats) -> float:
    """Return dL/dt of c + t direction, by differences of fourth order."""
    near, far = (
        model.loss(c + h * direction)[0] - model.loss(c - h * direction)[0] for h in (STEP, 2 * STEP)
    )
    return float(8 * near - far) / (12 * STEP)
