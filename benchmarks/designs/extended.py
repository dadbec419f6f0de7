"""The extended source of Table 6.3 of the thesis: two designs, and the method of the thesis from the same
start.

Run: thbcad bench extended
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.thesis_method import adam_batches
from optics.analysis import measure, nonsequential_figures
from optics.optimisation import State, design
from optics.problem import Problem, load_problem
from optics.runtime import Backend, Row, load_backend
from optics.system import base_lens, target_light
from optics.verification import StepFile, verify
from thbcad import write_step

THESIS_SECONDS, THESIS_FLUX = "thesis 1763 s", "thesis 0.74 W"


def rows() -> list[Row]:
    """Return the figures."""
    backend = load_backend("double")
    problem = load_problem(EXAMPLES / "extended.toml")
    light = target_light(problem)
    with tempfile.TemporaryDirectory() as folder:
        adam, other = _adam(problem, light, backend)
        one = _design("extended", Path(folder) / "one", other)
        two = _design("extended_two", Path(folder) / "two", other)
        batches = _batches(problem, light, backend, Path(folder) / "batch.step")
    return [*one, *two, *adam, *batches]


def _design(name: str, folder: Path, other: dict[str, float]) -> list[Row]:
    start = perf_counter()
    command = [sys.executable, "-m", "optics", "design", str(EXAMPLES / f"{name}.toml"), "--out", str(folder)]
    subprocess.run(command, check=True, capture_output=True)
    seconds = perf_counter() - start
    metrics = json.loads((folder / "metrics.json").read_text())
    checks = {c["name"]: c["value"] for c in json.loads((folder / "verify.json").read_text())["checks"]}
    return [
        Row(f"{name}: process start to verified result", seconds, "s", THESIS_SECONDS, 90),
        *_light(name, metrics, other),
        Row(f"{name}: degrees of freedom", metrics["dof"], "", "thesis 2180"),
        Row(f"{name}: evaluations of loss and gradient", metrics["evaluations"], "", "thesis 1500"),
        Row(
            f"{name}: landing points, independent trace",
            checks["landing points, independent trace of the file"],
            "mm",
            "",
            1e-8,
        ),
        Row(
            f"{name}: irradiance, independent trace",
            checks["irradiance, independent trace of the file, relative"],
            "",
            "",
            1e-6,
        ),
    ]


def _light(name: str, metrics: dict[str, Any], other: dict[str, float] | None = None) -> list[Row]:
    """Return rel_l2 and fluxes; limits are those of another design."""
    limits = other or {"rel_l2": None, "lit": None}
    count = metrics["nonsequential_w"]
    return [
        Row(f"{name}: rel_l2", metrics["rel_l2"], "", "", limits["rel_l2"]),
        Row(f"{name}: rel_l2 floor of the estimator", metrics["rel_l2_floor"]),
        Row(
            f"{name}: flux on the lit region, non-sequential",
            count["lit"],
            "W",
            THESIS_FLUX,
            limits["lit"],
            ">=",
        ),
        Row(f"{name}: flux on the lit region, front and rear only", count["lit_direct"], "W"),
        Row(f"{name}: flux on the target, non-sequential", count["target"], "W"),
    ]


def _adam(
    problem: Problem, light: NDArray[np.float64], backend: Backend
) -> tuple[list[Row], dict[str, float]]:
    """Return the rows of the thesis's method and its figures."""
    start = perf_counter()
    *_, lens = adam_batches(problem, light, backend)
    seconds = perf_counter() - start
    measurement = measure(backend, problem, lens, light)
    metrics = measurement.figures | {
        "nonsequential_w": nonsequential_figures(backend, problem, lens, measurement.target)
    }
    name = "6 batches of 250 Adam steps"
    dof = Row(f"{name}: degrees of freedom", lens.rear.sag.space.dim, "", "thesis 2180")
    figures = {"rel_l2": metrics["rel_l2"], "lit": metrics["nonsequential_w"]["lit"]}
    return [
        Row(f"{name}: optimisation alone", seconds, "s", THESIS_SECONDS),
        *_light(name, metrics),
        dof,
    ], figures


def _batches(problem: Problem, light: NDArray[np.float64], backend: Backend, path: Path) -> list[Row]:
    """Return the irradiance of every batch's STEP file by the independent tracer against the optimiser's
    tracer at equal rays."""
    out = []

    def check(state: State) -> None:
        lens = base_lens(problem).with_sags(state.sags)
        write_step(lens, path)
        checks = {c.name: c.value for c in verify(problem, lens, StepFile(path), backend)}
        difference = checks["irradiance, independent trace of the file, relative"]
        out.append(
            Row(
                f"extended, batch {len(out) + 1}: irradiance of its STEP, independent trace",
                difference,
                "",
                "",
                1e-6,
            )
        )

    design(problem, light, backend, checkpoint=check)
    return out
