"""Lenses with all errors at once: the time and memory of exact traces, and what single errors foretell.

Run: thbcad bench monte_carlo
"""

from __future__ import annotations

import tempfile
from math import sqrt
from pathlib import Path
from threading import Event, Thread
from time import perf_counter

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import run_design
from benchmarks.rows.row import Row
from optics import Design, monte_carlo, tolerances
from optics.tolerancing.monte_carlo_samples import MonteCarlo
from optics.tolerancing.perturbations import tolerances_of

SAMPLES, WORKERS = 512, 2
MOST_SECONDS, MOST_MB = 120.0, 1000.0
# of pearl.toml: a tenth of the usual amounts of source and target, which are those of a room
CAREFUL = 0.1
LOOK = 0.5  # seconds between two looks at the memory
TRACE = "exact cells, 3 x 3 in a pixel"


def rows() -> list[Row]:
    """Return the measured rows."""
    with tempfile.TemporaryDirectory() as folder:
        run_design(EXAMPLES / "pearl.toml", Path(folder) / "pearl")
        design = Design.load(Path(folder) / "pearl")
        amounts = {
            t.name: CAREFUL * t.amount
            for t in tolerances_of(design.system)
            if t.name.startswith(("source.", "target."))
        }
        budget = tolerances(design, amounts)
        memory, start = _Memory(), perf_counter()
        memory.start()
        made = monte_carlo(design, budget, SAMPLES, workers=WORKERS)
        return _rows(made, perf_counter() - start, memory.stop())


class _Memory(Thread):
    """The most memory that this process and its children hold together, shared pages counted once, MB."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.most, self._done = 0.0, Event()

    def run(self) -> None:
        while not self._done.wait(LOOK):
            self.most = max(self.most, sum(map(_proportional_mb, ["self", *_children()])))

    def stop(self) -> float:
        self._done.set()
        self.join()
        return self.most


def _children() -> list[str]:
    return [
        pid for task in Path("/proc/self/task").iterdir() for pid in (task / "children").read_text().split()
    ]


def _proportional_mb(pid: str) -> float:
    """Return the proportional set size of a process, 0 where it has ended."""
    try:
        text = Path(f"/proc/{pid}/smaps_rollup").read_text("ascii")
    except OSError:
        return 0.0
    (row,) = (line for line in text.splitlines() if line.startswith("Pss:"))
    return int(row.split()[1]) / 1024


def _rows(made: MonteCarlo, seconds: float, memory: float) -> list[Row]:
    batch, data = made.batch, made.data()
    median, worst = batch.quantile(0.5), batch.quantile(0.95)
    passing = batch.keeping({"rel_l2": made.budget.rel_l2 + made.budget.limit})
    return [
        Row(
            f"pearl at 256 x 256: {SAMPLES} lenses traced, {WORKERS} processes, all included",
            seconds,
            "s",
            "",
            MOST_SECONDS,
            estimator=TRACE,
        ),
        Row("  a lens, in its process", batch.seconds / SAMPLES, "s"),
        Row(
            "  most memory of all processes together",
            memory,
            "MB",
            "shared pages counted once",
            MOST_MB,
        ),
        Row("  rel_l2 of the design", made.budget.rel_l2, "", quantity="rel_l2", estimator=TRACE),
        _with_error("  median", median.value, median.high - median.value),
        _with_error("  95th percentile", worst.value, worst.high - worst.value),
        _with_error("  yield at 0.01 more than the design", passing.value, passing.high - passing.value),
        Row(
            "  root mean square by rises of single errors, over that of the lenses",
            made.expected / sqrt(batch.mean_square().value),
        ),
        Row("  lenses that could not be traced", data["not_traced"], "", "", 0),
    ]


def _with_error(name: str, value: float, error: float) -> Row:
    return Row(name, value, "", "95 % confidence", error=error, quantity="of lenses", estimator=TRACE)
