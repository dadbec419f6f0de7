"""`thbcad design` as a user runs it: in its own process, from the problem file to the verified folder."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, time
from typing import Any

from benchmarks.rows.row import Row

LIGHT_MISSES = 1  # exit code
LANDING = "landing points, independent trace of the file"
IRRADIANCE = "irradiance, independent trace of the file, relative"


@dataclass(frozen=True, eq=False)
class DesignRun:
    """A finished design.

    seconds : from the start of the process to its end.
    to_solid : seconds, from there until the STEP file lay in its place, verified.
    metrics : of metrics.json.
    checks : the values in verify.json by name.
    """

    seconds: float
    to_solid: float
    metrics: dict[str, Any]
    checks: dict[str, float]


def rel_l2_row(name: str, metrics: Mapping[str, Any], reference: str = "", limit: float | None = None) -> Row:
    """Return the row of a design's rel_l2, with the error of the measured irradiance."""
    return Row(
        name,
        metrics["rel_l2"],
        "",
        reference,
        limit,
        quantity="irradiance, box pixels, unit mean",
        estimator=metrics["estimator"],
        error=metrics["rel_l2_floor"],
    )


def run_design(problem: Path, folder: Path, must_pass: bool = True, module: str = "") -> DesignRun:
    """Design the lens of a problem file into a result folder, with every check that `thbcad design` makes.

    must_pass : the lens must do its job too, or else it may miss the light asked for.
    module : another program than the command, with the problem and the folder as its arguments.

    Raises CalledProcessError : the command refuses the problem, or a check fails.
    """
    start, begun = perf_counter(), time()
    words = [module, problem, folder] if module else ["optics", "design", problem, "--out", folder, "--force"]
    done = subprocess.run([sys.executable, "-m", *map(str, words)], capture_output=True)
    seconds = perf_counter() - start
    if must_pass or done.returncode != LIGHT_MISSES:
        done.check_returncode()
    metrics = json.loads((folder / "metrics.json").read_text("utf-8"))
    verified = json.loads((folder / "verify.json").read_text("utf-8"))
    to_solid = (folder / "verify.json").stat().st_mtime - begun  # the file is written once
    return DesignRun(
        seconds, to_solid, metrics, {check["name"]: check["value"] for check in verified["checks"]}
    )
