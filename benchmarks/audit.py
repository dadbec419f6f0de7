"""CPU seconds of designs in units of the calibration loop, as `thbcad audit` claims them.

Run: thbcad bench audit
"""

from __future__ import annotations

from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from benchmarks.rows.row import Row
from optics.interface.audit import CLAIMS, SLACK, experiments_in

RUNS = 3
NAMES = {"first": "first design, empty kernel cache", "later": "later designs"}


def rows() -> list[Row]:
    """Return the median of some runs, each with a kernel cache of its own."""
    claims = [claim for claim in CLAIMS if claim.key in NAMES]
    found: dict[str, list[float]] = {claim.key: [] for claim in claims}
    for _ in range(RUNS):
        with TemporaryDirectory() as place, experiments_in(Path(place)) as experiments:
            for claim in claims:
                value = claim.measure(experiments, claim.limit).value
                assert value is not None  # Dr.Jit kept its kernels in the folder
                found[claim.key].append(value)
    return [Row(NAMES[c.key], median(found[c.key]), "loops", "", SLACK * c.limit) for c in claims]
