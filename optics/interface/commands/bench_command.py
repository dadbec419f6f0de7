"""`thbcad bench`: the results of a benchmark beside their limits, stored and written into the pages.

The benchmarks and what stores them belong to a checkout, not to the packages.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from importlib import import_module
from pathlib import Path

from optics.base.runtime import UserError
from optics.interface.commands.outcome import DONE, MISSED, Outcome


def bench(options: Namespace) -> Outcome:
    """Run a benchmark of the checkout this package was installed from, or write the pages of stored rows."""
    root = checkout()
    if not (root / "benchmarks").is_dir():
        raise UserError("this installation has no benchmarks; run thbcad bench in a checkout")
    sys.path.insert(0, str(root))
    data, lines, ok = import_module("benchmarks.rows.bench_run").bench(root, options)
    return Outcome(data, lines, DONE if ok else MISSED)


def checkout() -> Path:
    """Return the folder that holds the packages, and in a checkout `benchmarks` and `docs`."""
    return Path(__file__).resolve().parents[3]
