"""A case as it is designed: a problem file of examples/others, perhaps with other keys, and its result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import rel_l2_row, run_design
from benchmarks.rows.row import Row
from optics.interface.api import Design
from optics.scene.problem import load_problem

OTHERS = EXAMPLES / "others"
# of a design's clock: what others time is the way to the finished surface, without files, checks and figures
SHAPING = ("setup", "optimise")


@dataclass(frozen=True, eq=False)
class CaseRun:
    """A finished case, as loaded from its folder.  seconds : from process start to verified result."""

    design: Design
    seconds: float

    @property
    def metrics(self) -> dict[str, Any]:
        return self.design.metrics

    @property
    def shaping(self) -> float:
        """Seconds from the problem to the last coefficient."""
        return float(sum(self.metrics["wall_s"].get(phase, 0.0) for phase in SHAPING))


def run_case(name: str, folder: Path, changes: Mapping[str, object] | None = None) -> CaseRun:
    """Design a case of examples/others.  changes : {dotted key: value}, in place of what its file says."""
    problem = folder / f"{name}_{len(list(folder.iterdir()))}.toml"
    problem.write_text(load_problem(OTHERS / f"{name}.toml", changes).to_toml(), "utf-8")
    out = problem.with_suffix("")
    run = run_design(problem, out, must_pass=False)
    return CaseRun(Design.load(out), run.seconds)


def light_rows(name: str, run: CaseRun, theirs: str, limit: float | None) -> list[Row]:
    """Return rel_l2 and SSIM of a case.  theirs : the published rel. L2.  limit : of rel_l2."""
    return [
        rel_l2_row(f"{name}: rel_l2", run.metrics, theirs, limit),
        Row("  ssim", run.metrics["ssim"]),
        Row("  efficiency", run.metrics["efficiency"]),
        Row("  degrees of freedom", run.metrics["dof"]),
    ]


def time_rows(run: CaseRun, theirs: str, limit: float | None) -> list[Row]:
    """Return the seconds of a case.  theirs : published.  limit : of the way to the finished surface."""
    return [
        Row("  to the finished surface", run.shaping, "s", theirs, limit),
        Row("  process start to verified result", run.seconds, "s"),
    ]
