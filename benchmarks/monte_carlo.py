"""Lenses with all errors at once: the time and memory of exact traces, and what single errors foretell.

Run: thbcad bench monte_carlo
"""

from __future__ import annotations

import tempfile
from math import sqrt
from pathlib import Path
from time import perf_counter

from benchmarks.checkout import EXAMPLES
from benchmarks.designs.design_run import run_design
from optics import Design, monte_carlo, tolerances
from optics.made_lenses import MonteCarlo
from optics.runtime import Row, peak_mb
from optics.tolerancing import tolerances_of

SAMPLES, WORKERS = 512, 2
MOST_SECONDS, MOST_MB = 120.0, 1000.0
# of pearl.toml: a tenth of the usual amounts of source and target, which are those of a room
CAREFUL = 0.1
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
        before = peak_mb()
        start = perf_counter()
        made = monte_carlo(design, budget, SAMPLES, workers=WORKERS)
        return _rows(made, perf_counter() - start, before)


def _rows(made: MonteCarlo, seconds: float, client: float) -> list[Row]:
    batch, data = made.batch, made.data()
    median, worst = batch.quantile(0.5), batch.quantile(0.95)
    passing = batch.passing(made.limit)
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
            "  most memory of the processes together",
            WORKERS * batch.peak_mb + client,
            "MB",
            f"{WORKERS} x {batch.peak_mb:.0f} + {client:.0f} of the program",
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
